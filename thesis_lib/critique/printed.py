"""Text of a diagnosis, as the command line prints it."""

from collections.abc import Mapping, Sequence

import pandas as pd

from thesis_lib.critique.engines.compare import bounded_text, missed_tosses, model_sentences, row_title
from thesis_lib.critique.results.titles import counted_from, handy_unit, origin_text
from thesis_lib.statistics.wording import bounded, carried

STATE_UNITS = {"vx": " m/s", "vy": " m/s", "omega": " rad/s", "theta": " rad", "x": " m"}


def diagnosis_text(content: Mapping) -> str:
    """Text of diagnosis.json: verdict, sentences, errors, parameters with effects, what to measure next."""
    lines = [f"{content['dataset']}: {content['verdict'] or 'no verdict'}", *(f"  {s}" for s in content["summary"])]
    if content["verdict"] is None:
        names = content["base_model"]["parameters"].items()
        return "\n".join([*lines, "", *(f"    {key:<14}{_value(p)}" for key, p in names)])
    lines += ["", *(_mechanism_errors(content) if "mechanism" in content else _errors(content))]
    width = max((14, *(len(key) + 2 for key in content["augmented_model"]["parameters"])))
    for key, p in content["augmented_model"]["parameters"].items():
        lines.append(f"    {key:<{width}}{_value(p)}")
    unit = "window" if "mechanism" in content else "impact"
    origins = {one["name"]: origin_text(one) for one in content.get("additions", ())}
    for effect in content["effects"]:
        if effect["name"] in origins:
            lines.append(f"    {effect['name']} is from {origins[effect['name']]}")
        for key, p in effect["parameters"].items():
            lines.append(f"    {effect['name']}.{key} {'' if p.get('bound') else '= '}{_value(p)}")
        if start := counted_from(effect["name"], content.get("reference", {}), effect["parameters"]):
            lines.append(f"      {start}")
        gain, (low, high) = effect["gain"], effect["gain"]["interval"]
        gained = gain[f"held_out_log_score_per_{unit}"]
        lines.append(
            f"      gains {gained:.3g} nats per {unit} (95 %: {low:.3g} to {high:.3g}), p = {gain['p_value']:.2g}"
        )
    if "models" in content:
        lines += ["", *_models(content["models"])]
    step = content["next_experiment"]
    if step["why"] or "mechanism" not in content:
        lines += ["", f"  next experiment: {step['why']}"]
    for state, sigmas in zip(step["states"], step.get("sigmas", ())):
        # the names of a mechanism's states contain the units
        units = dict.fromkeys(state, "") if "mechanism" in content else STATE_UNITS
        values = ", ".join(f"{name} {value:g}{units[name]}" for name, value in state.items())
        lines.append(f"    {values} ({sigmas:.2g} sigma)")
    return "\n".join(lines)


def _errors(content: Mapping) -> list[str]:
    names = {"no_impact": "no impact", "base": "base law", "augmented": "with effects"}
    names |= {"noise_floor": "noise floor", "irb_bound": "IRB bound"}
    values = {name: content["error"][key] for key, name in names.items()}
    return [
        f"  {content['n_impacts']} impacts of {content['n_trials']} trials; held-out error in m/s:",
        *(f"    {name:<14}{'unknown' if v is None else f'{v:.4g}'}" for name, v in values.items()),
    ]


def _mechanism_errors(content: Mapping) -> list[str]:
    names = {"base": "believed model", "augmented": "with effects", "noise_floor": "noise alone"}
    return [
        f"  {content['mechanism']}: {content['n_windows']} windows of {content['n_trials']} trials; "
        "held-out misfit in standard deviations of noise:",
        *(f"    {name:<16}{content['error'][key]:.4g}" for key, name in names.items()),
    ]


def _value(p: Mapping) -> str:
    unit = "" if p["unit"] == "1" else f" {p['unit']}"
    if p.get("bound"):
        return bounded(p, unit.strip())
    if not p["std"]:
        return f"{p['value']:.4g}{unit}"
    factor, unit = handy_unit(p["value"], p["unit"])
    value, std = factor * p["value"], factor * p["std"]
    decimals = carried(std)
    return f"{value:z.{decimals}f} ± {std:.{decimals}f}{'' if unit == '1' else f' {unit}'}"


def _models(rows: Sequence[Mapping]) -> list[str]:
    """Lines of the comparison of laws and engines."""
    lines = [f"  {sentence}" for sentence in model_sentences(pd.DataFrame(rows))]
    titles = [row_title(row) for row in rows]
    width = max(map(len, titles))
    follows = "position" in rows[0]
    head = "  tosses: position, angle" * follows
    lines.append(f"    {'model':<{width}}  effects  error (m/s)  mu      epsilon{head}")
    for title, row in zip(titles, rows):
        numbers = f"{row['error']:<11.4g}  {bounded_text(row, 'mu', 3):<7} {bounded_text(row, 'epsilon', 3)}"
        if follows:
            numbers = f"{numbers:<28}  {', '.join(missed_tosses(row))}"
        lines.append(f"    {title:<{width}}  {row['effects']:<7}  {numbers}")
    return lines
