"""Turbulence against the closed forms of MIL-F-8785C, never against the filters that make it."""

import math

import numpy as np
import pytest
from scipy import integrate, linalg, signal, stats

from estimator.compiler.jit import kernel
from sim.air import Air, MovingAir
from sim.air.dryden import FAR_M, SEVERITIES_M_S, add_turbulence, strengths, transition

FT = 0.3048
V, H, SPAN, W20 = 12.0, 30.0, 1.7, 8.0
NAMES = "uvwpqr"
LEVEL = 1e-4  # of each two-sided statistical bound below; the seeds are fixed


@kernel
def walk(distance_m, height_m, noise, state, out):
    """Rows of `out`: wind (3) and rates (3) of the turbulence after each step."""
    s = state[0]
    for k in range(noise.shape[0]):
        out[k] = 0.0
        add_turbulence(distance_m, height_m, noise[k], s, out[k, :3], out[k, 3:])


@kernel
def walk_anew(distance_m, ticks, height_m, noise, state, out):
    """For each block of noise: first row of `out` independent of all before, second row `ticks` steps later."""
    s = state[0]
    for n in range(noise.shape[0]):
        for k in range(ticks + 1):
            out[n, 1] = 0.0
            add_turbulence(FAR_M if k == 0 else distance_m, height_m, noise[n, k], s, out[n, 1, :3], out[n, 1, 3:])
            if k == 0:
                out[n, 0] = out[n, 1]


def state_of(wind_e=(5.0, 0.0, 0.0), w20=W20):
    return MovingAir(Air(wind_e, w20), SPAN, 0.02, 0.0, seed=0).state


def theory(height_m=H, w20=W20):
    """Strengths and scales of the standard, worked in feet: sigma_u = sigma_v, sigma_w, L_u = L_v, L_w."""
    h = height_m / FT
    sigma_w = 0.1 * w20
    factor = 0.177 + 0.000823 * h
    return sigma_w / factor**0.4, sigma_w, h / factor**1.2 * FT, h * FT


def spectrum(name, omega):
    """One-sided spectrum of MIL-F-8785C over the spatial frequency [rad/m]."""
    sigma_u, sigma_w, scale_u, scale_w = theory()
    sigma, scale = (sigma_u, scale_u) if name in "uvr" else (sigma_w, scale_w)
    x2 = (scale * omega) ** 2
    if name == "u":
        return sigma**2 * 2.0 * scale / np.pi / (1.0 + x2)
    if name == "p":
        share = 0.8 * (np.pi * scale / (4.0 * SPAN)) ** (1.0 / 3.0)
        return sigma**2 / scale * share / (1.0 + (4.0 * SPAN * omega / np.pi) ** 2)
    across = sigma**2 * scale / np.pi * (1.0 + 3.0 * x2) / (1.0 + x2) ** 2
    if name in "vw":
        return across
    return omega**2 * across / (1.0 + ({"q": 4.0, "r": 3.0}[name] * SPAN * omega / np.pi) ** 2)


def covariance(name, distance_m=0.0):
    """Autocovariance at a distance: the cosine transform of the spectrum."""
    if distance_m == 0.0:
        low, high = (integrate.quad(lambda o: spectrum(name, o), *ends)[0] for ends in ((0.0, 1.0), (1.0, np.inf)))
        return low + high
    kwargs = {"weight": "cos", "wvar": distance_m, "limit": 500}
    return integrate.quad(lambda o: spectrum(name, o), 0.0, np.inf, **kwargs)[0]


@pytest.fixture(scope="module")
def record():
    """90 minutes at 50 Hz."""
    noise = np.random.default_rng(1).standard_normal((270_000, 8))
    out = np.zeros((len(noise), 6))
    state = state_of()
    walk(FAR_M, H, noise[:1], state, out[:1])
    walk(V * 0.02, H, noise[1:], state, out[1:])
    return out


def test_variance_of_the_spectra_is_that_of_the_standard():
    """The oracle itself: the spectra of u, v, w integrate to sigma squared (closed form pi / 2 and pi)."""
    sigma_u, sigma_w, _, _ = theory()
    for name, sigma in zip("uvw", (sigma_u, sigma_u, sigma_w), strict=True):
        assert covariance(name) == pytest.approx(sigma**2, rel=1e-8)


@pytest.mark.parametrize("name", NAMES)
def test_spectrum_of_each_component_is_that_of_the_standard(record, name):
    """Welch's spectrum over octaves lies within the chi-square bound of the standard's, sampled at 50 Hz."""
    length, fs = 8192, 50.0
    f, found = signal.welch(record[:, NAMES.index(name)], fs, "hann", length, noverlap=0, detrend=False)
    folds = np.abs(f[:, None] + fs * np.arange(-400, 401))  # sampling folds what is above 25 Hz back
    expected = np.sum(2.0 * np.pi / V * spectrum(name, 2.0 * np.pi * folds / V), axis=1)
    segments = len(record) // length
    for low in 0.05 * 2.0 ** np.arange(8):
        # Every third line: neighbours are correlated by the Hann window.  From 8 lines on, no leak to speak of.
        lines = np.flatnonzero((f >= low) & (f < min(2.0 * low, 24.0)))[::3]
        freedom = 2 * segments * len(lines)
        bounds = stats.chi2.ppf([LEVEL / 2.0, 1.0 - LEVEL / 2.0], freedom) / freedom
        assert bounds[0] < np.mean(found[lines] / expected[lines]) < bounds[1], f"{name} from {low:g} Hz"


@pytest.mark.parametrize("hz", [50, 100, 200])
def test_variance_and_correlation_do_not_depend_on_the_time_step(hz):
    """Of 12000 independent pairs half a second apart: variances within chi-square, correlations within Fisher's z."""
    n, lag_s = 12_000, 0.5
    ticks = round(lag_s * hz)
    noise = np.random.default_rng(hz).standard_normal((n, ticks + 1, 8))
    pairs = np.zeros((n, 2, 6))
    walk_anew(V / hz, ticks, H, noise, state_of(), pairs)
    chi2 = stats.chi2.ppf([LEVEL / 2.0, 1.0 - LEVEL / 2.0], n)
    z = stats.norm.ppf(1.0 - LEVEL / 2.0) / math.sqrt(n - 3)
    for i, name in enumerate(NAMES):
        variance = covariance(name)
        for column in (0, 1):
            assert chi2[0] < np.sum(pairs[:, column, i] ** 2) / variance < chi2[1], (name, column)
        expected = covariance(name, V * lag_s) / variance
        found = np.corrcoef(pairs[:, 0, i], pairs[:, 1, i])[0, 1]
        assert abs(math.atanh(found) - math.atanh(expected)) < z, name


def test_components_are_independent_but_for_q_with_w_and_r_with_v():
    """No correlation beyond Fisher's z; q and w, r and v as the filters of the standard have it."""
    n = 60_000
    noise = np.random.default_rng(5).standard_normal((n, 1, 8))
    pairs = np.zeros((n, 2, 6))
    walk_anew(0.0, 0, H, noise, state_of(), pairs)
    found = np.corrcoef(pairs[:, 0].T)
    z = stats.norm.ppf(1.0 - LEVEL / 2.0) / math.sqrt(n - 3)
    for a, b in ((a, b) for i, a in enumerate(NAMES) for b in NAMES[:i]):
        expected = 0.0
        if (a, b) in (("q", "w"), ("r", "v")):
            mean_m = {"q": 4.0, "r": 3.0}[a] * SPAN / np.pi

            def real(omega, b=b, mean_m=mean_m):  # of i Omega / (1 + i l Omega)
                return spectrum(b, omega) * mean_m * omega**2 / (1.0 + (mean_m * omega) ** 2)

            sign = -1.0 if a == "q" else 1.0  # rising air ahead (w below 0) turns the air nose up
            expected = sign * integrate.quad(real, 0.0, np.inf, limit=500)[0]
            expected /= math.sqrt(covariance(a) * covariance(b))
            assert abs(expected) > 0.05
        assert abs(math.atanh(found[NAMES.index(a), NAMES.index(b)]) - math.atanh(expected)) < z, (a, b)


def test_correlation_along_an_oblique_wind_is_the_long_one():
    """For wind from the south-west: exp(-x / L) along it, (1 - x / 2L) exp(-x / L) across (Dryden's pair), x = L."""
    n = 12_000
    _, _, scale_u, _ = theory()
    noise = np.random.default_rng(6).standard_normal((n, 2, 8))
    pairs = np.zeros((n, 2, 6))
    walk_anew(scale_u, 1, H, noise, state_of((3.0, 3.0, 0.0)), pairs)
    z = stats.norm.ppf(1.0 - LEVEL / 2.0) / math.sqrt(n - 3)
    for sign, expected in ((1.0, math.exp(-1.0)), (-1.0, 0.5 * math.exp(-1.0))):
        gust = (pairs[:, :, 0] + sign * pairs[:, :, 1]) / math.sqrt(2.0)
        assert abs(math.atanh(np.corrcoef(gust.T)[0, 1]) - math.atanh(expected)) < z


@pytest.mark.parametrize("height_m", [5.0, 20.0, 60.0, 150.0])
def test_strengths_follow_height_and_wind_as_the_standard_says(height_m):
    """Round-off apart, the formulae in feet."""
    np.testing.assert_allclose(strengths(height_m, 7.0), theory(height_m, 7.0), rtol=1e-12, atol=0)
    doubled = np.array(strengths(height_m, 14.0)) / strengths(height_m, 7.0)
    np.testing.assert_allclose(doubled, [2.0, 2.0, 1.0, 1.0], rtol=1e-15, atol=0)


def test_strengths_at_1000_ft_are_isotropic_and_beyond_the_bounds_held():
    """0.177 + 0.823 = 1: at 1000 ft nothing distinguishes the axes any more; 10 ft is as low as the standard goes."""
    np.testing.assert_allclose(strengths(1000 * FT, 10.0), (1.0, 1.0, 1000 * FT, 1000 * FT), rtol=1e-12, atol=0)
    assert strengths(2000 * FT, 10.0) == strengths(1000 * FT, 10.0)
    assert strengths(0.0, 10.0) == strengths(1.0, 10.0) == strengths(10 * FT, 10.0)


def test_severities_are_15_30_and_45_knots():
    """As MIL-F-8785C names them, to the centimetre per second."""
    knots = [SEVERITIES_M_S[word] / 0.514444 for word in ("light", "moderate", "severe")]
    np.testing.assert_allclose(knots, [15.0, 30.0, 45.0], rtol=0, atol=0.01)


@pytest.mark.parametrize("distance_m", [0.0, 1e-3, 0.24, 3.0, 80.0, FAR_M])
@pytest.mark.parametrize("averaged_m", [1.6, 30.0, 200.0], ids=["shorter", "equal", "longer"])
def test_transition_is_the_matrix_exponential_and_van_loans_covariance(distance_m, averaged_m):
    """SciPy's expm of the system, and of Van Loan's block matrix; the case of equal scales is no exception."""
    scale_m, state = 30.0, state_of()
    transition(distance_m, scale_m, averaged_m, state[0])
    a, root3 = 1.0 / averaged_m, math.sqrt(3.0)
    A = np.array([[-1 / scale_m, 0, 0], [1 / scale_m, -1 / scale_m, 0], [root3 * a, (1 - root3) * a, -a]])
    BB = np.diag([1.0 / scale_m, 0.0, 0.0])
    if distance_m < 20.0 * averaged_m:
        block = linalg.expm(np.block([[-A, BB], [np.zeros((3, 3)), A.T]]) * distance_m)
        phi = block[3:, 3:].T
        spread = phi @ block[:3, 3:]
    else:  # Van Loan's block would grow beyond round-off; the stationary covariance less what is forgotten
        phi = linalg.expm(A * min(distance_m, 1e4))
        whole = linalg.solve_continuous_lyapunov(A, -BB)
        spread = whole - phi @ whole @ phi.T
    np.testing.assert_allclose(state[0]["phi"], phi, rtol=0, atol=1e-13)
    np.testing.assert_allclose(state[0]["spread"], spread, rtol=1e-9, atol=1e-14)


def test_turbulence_at_rest_in_still_air_stands_still():
    """No air has passed: nothing changes, bit for bit."""
    noise = np.random.default_rng(7).standard_normal((3, 8))
    out = np.zeros((3, 6))
    state = state_of()
    walk(FAR_M, H, noise[:1], state, out[:1])
    walk(0.0, H, noise[1:], state, out[1:])
    assert (out[1] == out[0]).all()
    assert (out[2] == out[0]).all()
    assert np.abs(out[0]).min() > 0.0


def test_turbulence_of_no_strength_is_none():
    """W20 of 0 leaves the mean wind alone."""
    noise = np.random.default_rng(8).standard_normal((5, 8))
    out = np.zeros((5, 6))
    walk(3.0, H, noise, state_of(w20=0.0), out)
    assert not out.any()
