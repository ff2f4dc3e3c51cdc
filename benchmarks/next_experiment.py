"""How many drops settle a question: in the states that the critique proposes, and as random ones.

    python -m benchmarks.next_experiment [-n QUESTIONS] [--quick] [-o FILE.csv]

The first of the stored questions that 50 random drops leave open (config/proof/next_experiment.csv) are asked again:
drops are simulated, two effects are fitted, states are proposed, and drops added until the log scores differ by three
nats.  CPU time on one core.
"""

import time

from benchmarks.results import Results, at_least, benchmark_parser
from thesis_lib.studies.proof.next_drops import KEY, Question, ask, read_answers


def measure(n: int, results: Results) -> None:
    """Ask `n` questions again; add the drops that each way takes in all, and what a question costs."""
    stored = read_answers().query("open")[:n]
    start = time.process_time()
    answers = [ask(Question(*key)) for key in stored[list(KEY)].itertuples(index=False)]
    spent = (time.process_time() - start) / len(answers)
    random, chosen = (sum(answer[way] for answer in answers) for way in ("random", "chosen"))
    halved = sum(answer["chosen"] <= 0.5 * answer["random"] for answer in answers)
    ways = ["random", "chosen"]
    same = sum([now[way] for way in ways] == then for now, then in zip(answers, stored[ways].to_numpy().tolist()))
    of = f"{len(answers)} questions"
    results.add("drops, random", random, "1", of)
    results.add("drops, proposed states", chosen, "1", of)
    results.add("proposed over random", chosen / random, "1", "of all drops; asked for: at most 0.5")
    results.add("settled with half the drops", halved / len(answers), "1", of)
    results.add("as stored", same / len(answers), "1", "questions whose counts are those of the table")
    results.add("a question", spent, "CPU s", "simulation, both fits, proposal, drops until it is settled")
    print(f"{of}: {chosen:g} drops instead of {random:g}; {spent:.1f} CPU s a question")


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = benchmark_parser("next_experiment", "Settle questions with proposed and with random drops.")
    parser.add_argument("-n", type=at_least(1), default=20, metavar="QUESTIONS", help="questions (20)")
    options = parser.parse_args(arguments)
    results = Results("next_experiment")
    measure(1 if options.quick else options.n, results)
    results.write(options.out)


if __name__ == "__main__":
    main()
