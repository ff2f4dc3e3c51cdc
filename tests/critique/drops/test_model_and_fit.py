"""The model without effects is the law; covariances are those of synthetic data; fits find what was put in."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hidden_effects import LAW, TRUTH, injected, observed
from scipy.optimize import minimize_scalar
from scipy.stats import multivariate_t

from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.world import Drops, channel_is_material
from thesis_lib.critique.drops.world import testable_effects as usable_effects
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import fit
from thesis_lib.critique.likelihood.observations import observe
from thesis_lib.critique.likelihood.sandwich import cramer_rao
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.critique.likelihood.whitening import NU, Whitening, log_t, most_probable_scatter
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Parameter
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import PLANE
from thesis_lib.studies.proof.cases import Case, make

EXACT = 1e-12  # rounding of two orders of the same operations
SIGMAS = 4.0
NATS = 6.0  # that one more parameter gains by chance in a hundred thousand fits
WIDEST = 1.15  # times the bound: 1.02 by the t distribution, the rest by scatter that is fitted, too
RECOVERED = (
    *("tangential_restitution", "anisotropic_friction", "contact_torque", "com_offset"),
    *("surface_tilt", "linear_drag", "moving_surface", "angle_offset"),
)
PATCH = EFFECTS["surface_patch"]
TIMED = [effect for effect in EFFECTS.values() if effect.needs_contact_time]


def test_each_trial_is_judged_once_by_a_fit_to_the_others():
    """Restitution is another one in every sixth trial: no fit that has not seen these predicts them."""
    o = observed()
    odd_one = o.trial % 6 == 0
    made = (synthesise(Comparison(Model(LAW), TRUTH | {"epsilon": e}, o), np.random.default_rng(1)) for e in (0.6, 0.4))
    ordinary, odd = (np.stack([one.value, one.slope]) for one in made)
    value, slope = np.where(odd_one[:, None, None], odd, ordinary)
    world = Drops(replace(o, value=value, slope=slope))
    judged = world.cross_validate(fit(Model(LAW), world.observations, TRUTH), world.trials % 6)
    assert sorted(judged.trial) == sorted(o.trial)
    odd_ones, others = (judged.error[(judged.trial % 6 == 0) == is_odd].mean() for is_odd in (True, False))
    assert odd_ones > 10.0 * others


@pytest.mark.parametrize("name", SIX_LAWS)
def test_without_effects_the_model_is_the_law(name):
    o = observed()
    before = Comparison(Model(LAW), TRUTH, o).before
    after = bind(Model(LAWS[name]), TRUTH, o.rig).predict(before)
    r = o.rig.shape.contact_point(before.theta)
    out = LAWS[name](before.v, r, mass=1.0, k_g=o.rig.k_g, **TRUTH)
    np.testing.assert_allclose(after.v, out.v_post, atol=EXACT * 100)  # ω divides by k² = 4e-4
    assert np.abs(after.v - before.v).max() > 1.0


@pytest.mark.parametrize("effect", [None, "com_offset"])
def test_covariance_of_residuals_is_that_of_synthetic_data(effect):
    draws = 400  # a variance is then known to 7 %, and the mean over 30 impacts to 2 %
    model = Model(LAW, () if effect is None else (EFFECTS[effect],))
    values = TRUTH if effect is None else injected(effect)[1]
    rng = np.random.default_rng(0)
    o = observed().select(np.unique(observed().trial)[:9])
    o = synthesise(Comparison(model, values, o), rng)
    assert 25 <= len(o) <= 40
    R = np.stack([Comparison(model, values, synthesise(Comparison(model, values, o), rng)).R for _ in range(draws)])
    S = Comparison(model, values, o).covariance(instant=0.0)
    std = np.sqrt(np.einsum("nii->ni", S))
    drawn = R / std
    drawn = drawn - drawn.mean(axis=0)
    empirical = np.einsum("dni,dnj->nij", drawn, drawn) / (draws - 1)
    correlation = S / std[:, :, None] / std[:, None, :]
    # the median over impacts: single ones stand at the kink between sticking and sliding, where no secant is exact
    assert np.abs(np.median(empirical - correlation, axis=0)).max() < 0.06
    assert np.median(np.abs(empirical - correlation)) < 0.06
    whitened = np.linalg.solve(S, empirical * std[:, :, None] * std[:, None, :])
    assert np.median(np.trace(whitened, axis1=1, axis2=2)) / S.shape[1] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("name", RECOVERED)
def test_fit_finds_the_parameters_of_an_injected_effect(name):
    o, values = injected(name)
    fitted = fit(Model(LAW, (EFFECTS[name],)), o)
    for key, value in values.items():
        assert fitted.std[key] > 0.0
        assert abs(fitted.values[key] - value) < SIGMAS * fitted.std[key], key
    effect = EFFECTS[name]
    # it can tell the injected size from none
    key = f"{name}.{effect.parameters[0].name}"
    assert abs(values[key] - effect.parameters[0].null) > SIGMAS * fitted.std[key]
    assert fitted.score > fit(Model(LAW), o).score + 10.0


def test_a_fit_to_no_impact_says_what_is_missing():
    o = observed()
    for takes_time in (False, True):
        with pytest.raises(UserError, match="no impacts to fit"):
            fit(Model(LAW, takes_time=takes_time), o.rows(np.zeros(0, int)))


def test_fit_finds_extra_scatter():
    scatter = 0.05  # m/s, ten times the noise of a velocity
    o = synthesise(Comparison(Model(LAW), TRUTH, observed()), np.random.default_rng(3), scatter=scatter)
    assert fit(Model(LAW), o).sigma_m == pytest.approx(scatter, rel=0.2)
    quiet = synthesise(Comparison(Model(LAW), TRUTH, observed()), np.random.default_rng(3))
    assert fit(Model(LAW), quiet).sigma_m < 0.1 * scatter


def test_fit_stays_within_bounds():
    o, values = injected("linear_drag", factor=2.0)
    drag = EFFECTS["linear_drag"]

    class Narrow(type(drag)):
        parameters = tuple(
            Parameter(p.name, p.unit, p.null, -0.5 * p.scale, 0.5 * p.scale, 0.5 * p.scale) for p in drag.parameters
        )

    fitted = fit(Model(LAW, (Narrow(),)), o)
    for p in Narrow.parameters:
        key = f"linear_drag.{p.name}"
        assert values[key] > p.high
        assert fitted.values[key] == p.high  # as far as it may go, and no farther
    assert all(p.low <= fitted.values[name] <= p.high for name, p in fitted.model.parameters.items())


@pytest.mark.parametrize("factor", [0.3, 1.0, 2.5])
def test_a_law_that_is_wrong_still_starts_in_the_right_basin(factor):
    """Most impacts stick here: at a large μ all do, no step changes anything, and every effect would look absent."""
    o, _ = injected("anisotropic_friction", factor)
    fitted = fit(Model(LAW), o)
    assert fitted.values["mu"] == pytest.approx(TRUTH["mu"], rel=0.25)
    assert fitted.std["mu"] > 0.0
    true = fit(Model(LAW, (EFFECTS["anisotropic_friction"],)), o)
    assert true.values["mu"] == pytest.approx(TRUTH["mu"], rel=0.02)


def test_perfectly_elastic_bodies_stay_within_bounds():
    o = synthesise(Comparison(Model(LAW), {"mu": 0.0, "epsilon": 1.0}, observed()), np.random.default_rng(1))
    fitted = fit(Model(LAW), o)
    assert 0.0 <= fitted.values["mu"] < 1e-3
    assert 1.0 - 1e-2 < fitted.values["epsilon"] <= 1.0


def test_an_effect_that_is_on_or_off_is_switched_on_not_fitted():
    o, _ = injected("mirrored_rotation")
    fitted = fit(Model(LAW, (EFFECTS["mirrored_rotation"],)), o)
    assert fitted.values["mirrored_rotation.mirrored"] == 1.0
    assert fitted.std["mirrored_rotation.mirrored"] == 0.0
    assert abs(fitted.values["mu"] - TRUTH["mu"]) < SIGMAS * fitted.std["mu"]
    assert fitted.score > fit(Model(LAW), o).score + 1000.0


def test_log_scores_add_up_to_the_score_of_the_fit():
    o = observed()
    fitted = fit(Model(LAW), o)
    S = fitted.on(o).covariance()
    score, flight_score = Whitening(fitted.model, o, S, fitted.sigma_m).log_scores(fitted.values)
    assert score.shape == (len(o),) and flight_score.shape == (len(o.flights),)
    assert score.sum() + flight_score.sum() == pytest.approx(fitted.score, rel=1e-9)


def test_the_score_is_a_normalised_t_distribution():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((5, 3, 3)) + 3.0 * np.eye(3)
    S = root @ np.swapaxes(root, 1, 2)
    x = rng.standard_normal((5, 3)) * 4.0
    L = np.linalg.cholesky(S)
    z = np.linalg.solve(L, x[:, :, None])[:, :, 0]
    ours = log_t(z, np.linalg.slogdet(S)[1])
    theirs = [multivariate_t.logpdf(x[i], shape=S[i], df=NU) for i in range(5)]
    np.testing.assert_allclose(ours, theirs, atol=1e-10)


def test_errors_are_no_smaller_than_the_cramer_rao_bound_and_hardly_larger():
    effect = EFFECTS["surface_tilt"]
    model, values = Model(LAW, (effect,)), TRUTH | {"surface_tilt.phi": 0.02}
    o = synthesise(Comparison(model, values, observed()), np.random.default_rng(8))
    bound, fitted = cramer_rao(model, values, o), fit(model, o, values)
    for name in values:
        assert 1.0 < fitted.std[name] / bound[name] < WIDEST, name
    # half the noise, half the bound
    assert cramer_rao(model, values, replace(o, cov=0.25 * o.cov))["mu"] / bound["mu"] == pytest.approx(0.5, rel=0.1)
    # noise that is larger than stated shows in the errors
    loud = synthesise(Comparison(model, values, replace(o, cov=9.0 * o.cov)), np.random.default_rng(9))
    assert fit(model, replace(loud, cov=o.cov), values).std["mu"] > 1.5 * fitted.std["mu"]


@pytest.mark.parametrize("seed", [16, 44])
def test_a_fit_does_not_stay_where_everything_sticks(seed):
    # development seeds of the proof, on which a fit that starts with much friction ends at μ = 0.8 and 1.3
    dataset, true = make(Case("law", "nothing", seed))
    o = observe(dataset)
    fitted = fit(Model(LAWS["wang_mason"]), o.select(np.unique(o.trial)[:105]))
    assert abs(fitted.values["mu"] - true["mu"]) < 0.01  # a few hundred sliding impacts tell it to 1e-4


def test_the_scatter_is_the_most_probable_one_of_single_hits_and_of_episodes():
    rng = np.random.default_rng(0)
    span = np.repeat([0.0, 0.03], 20)
    k = 0.02
    # the velocity after the (first) hit scatters, and moves the pose until the next flight
    D = np.zeros((40, 7, 7))
    moves = np.zeros((40, 7, 3))
    moves[:, :3] = np.diag([1.0, 1.0, 1.0 / k])
    moves[:, 3:6] = span[:, None, None] * moves[:, :3]
    D = moves @ np.swapaxes(moves, 1, 2)
    root = 0.1 * rng.standard_normal((40, 7, 7)) + 0.3 * np.eye(7)
    S = root @ np.swapaxes(root, 1, 2)
    R = np.array([rng.multivariate_normal(np.zeros(7), s + 0.8**2 * d) for s, d in zip(S, D)])

    def loss(log_sigma: float) -> float:
        variance = S + np.exp(2.0 * log_sigma) * D
        return -sum(multivariate_t.logpdf(r, shape=s, df=NU) for r, s in zip(R, variance))

    direct = minimize_scalar(loss, bounds=(-5.0, 1.0), method="bounded")
    found = most_probable_scatter(R, S, SimpleNamespace(span=span, space=PLANE, rig=SimpleNamespace(k_g=k)))
    assert loss(np.log(found)) == pytest.approx(direct.fun, abs=0.05)
    assert found == pytest.approx(np.exp(direct.x), rel=0.1)


def patch(**p: float) -> dict[str, float]:
    return {f"surface_patch.{q.name}": q.null for q in PATCH.parameters} | {
        f"surface_patch.{k}": v for k, v in p.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize("where", [(0.05, 0.2), (-0.3, -0.15), (0.1, 2.0)], ids=["right", "left", "step"])
def test_a_fit_finds_a_patch_wherever_it_is(where):
    model = Model(LAW, (PATCH,), takes_time=True)
    true = TRUTH | {"tau": 5e-4} | patch(h_eps=-0.2, h_mu=0.4, x_1=where[0], x_2=where[1], w=0.01)
    data = synthesise(Comparison(model, true, observed(120)), np.random.default_rng(3))
    plain = fit(Model(LAW, (), takes_time=True), data)
    found = fit(model, data, plain.values)
    assert found.score > plain.score + 100.0
    for name in ("h_eps", "h_mu", "x_1"):
        key = f"surface_patch.{name}"
        assert abs(found.values[key] - true[key]) < SIGMAS * found.std[key], name
    if where[1] > 1.0:
        # the same from nothing
        assert fit(model, data).score == pytest.approx(found.score, abs=1.0)


@pytest.mark.parametrize("effect", TIMED, ids=lambda effect: effect.name)
def test_contacts_that_are_too_short_to_see_call_for_no_time_of_any_kind(effect):
    timed = Model(LAW, takes_time=True)
    plain = fit(timed, observed(120))
    with_it = fit(timed.with_effect(effect), observed(120), plain.values)
    assert with_it.score - plain.score < NATS
    assert all(abs(with_it.values[name] - plain.values[name]) < plain.std[name] for name in ("mu", "epsilon"))


def test_contacts_that_are_instants_have_no_time_to_test():
    testable, why_not = usable_effects(observed(), timed=False)
    assert {effect.name for effect in TIMED} <= set(why_not) and "surface_patch" in testable
    assert {why_not[effect.name] for effect in TIMED} == {"contacts are taken as instants"}
    assert not set(usable_effects(observed(), timed=True)[1]) & {effect.name for effect in TIMED}


def test_a_fault_of_a_quarter_of_the_touches_is_seen_and_matters():
    data = observed(120)
    plain = fit(Model(LAW, takes_time=True), data)
    value = data.value.copy()
    value[::4, :, 1] += 2e-3  # m; a fault of six times the camera's noise
    sound, faulty = (Drops(o).judge(plain) for o in (data, replace(data, value=value)))
    assert sound.sigmas["touch"] < 1.3
    # a median sees a quarter of it
    assert faulty.sigmas["touch"] > 4.0 * sound.sigmas["touch"]
    assert channel_is_material(sound, faulty, "touch", CritiqueSettings())
    assert not channel_is_material(sound, faulty, "flight", CritiqueSettings())
