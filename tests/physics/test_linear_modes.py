"""Linear models and modes against the flight of the whole aeroplane, against closed forms, and against the textbook."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import curve_fit

from sim.aeroplane.derivatives import Airframe, coefficients, lanchester, textbook
from sim.aeroplane.jsbsim_model import AIRCRAFT, Model
from sim.aeroplane.linear import ASYMMETRIC, HEIGHT, STATES, SYMMETRIC, LinearModel, linearise, modes
from sim.aeroplane.performance import measure
from sim.aeroplane.trim import Trim, accelerations, trim

NAMES = sorted(p.parent.name for p in AIRCRAFT.glob("*/airframe.toml"))
HEIGHT_M, G_M_S2 = 60.0, 9.80665
FINE_HZ = 2000  # JSBSim integrates to first order: the fastest root, 30 / s, is then off by less than 1 %
READ = (
    *(f"velocities/{a}-fps" for a in "uvw"),
    *(f"velocities/{a}-rad_sec" for a in "pqr"),
    *(f"attitude/{a}-rad" for a in ("phi", "theta", "psi")),
)


@pytest.fixture(scope="module", params=NAMES)
def flown(request):
    """A finely stepped model, its linear model at the cruise, and its modes by name."""
    model = Model(request.param, FINE_HZ)
    linear = linearise(model, trim(model, model.airframe["cruise"]["airspeed_m_s"], HEIGHT_M), HEIGHT_M)
    return model, linear, {m.name: m for m in modes(linear)}


def response(model, linear, kick, seconds):
    """Times and deviations from the trim (u v w p q r roll pitch yaw) of the whole aeroplane after `kick` (9,)."""
    x = linear.x.copy()
    x[:9] += kick
    start = (tuple(x[6:9]), x[:3], tuple(x[3:6]))
    model.place(HEIGHT_M, *start, linear.u, _still(), 1)
    model.settle()
    read = [model.getter(p) for p in READ]
    scale = np.array([0.3048] * 3 + [1.0] * 6)
    rows = []
    for _ in range(round(seconds / model.dt_s)):
        rows.append([g() for g in read])
        model.run()
    t = model.dt_s * np.arange(len(rows))
    away = np.array(rows) * scale - linear.x[:9]
    away[:, 6:] = (away[:, 6:] + np.pi) % (2.0 * np.pi) - np.pi  # JSBSim's heading runs from 0 to 2 pi
    return t, away


def _still():
    from sim.air import STILL

    return STILL


def kicked(**changes):
    kick = np.zeros(9)
    for name, value in changes.items():
        kick[STATES.index(name)] = value
    return kick


@pytest.mark.parametrize(
    ("kick", "seconds", "watched"),
    [
        (kicked(w=0.1, q=0.1), 0.5, "wq"),
        (kicked(v=0.1, r=0.05), 1.5, "vr"),
        (kicked(p=0.2), 0.3, "p"),
    ],
    ids=["short period", "Dutch roll", "roll"],
)
def test_linear_model_moves_like_the_whole_aeroplane(flown, kick, seconds, watched):
    """After a small kick exp(A t) stays within 3 % of the greatest deviation (measured 1 to 2: the integrator's)."""
    model, linear, _ = flown
    t, moved = response(model, linear, kick, seconds)
    A = linear.A[:9, :9]
    step = expm(A * model.dt_s)
    x, foreseen = kick, []
    for _ in t:
        foreseen.append(x)
        x = step @ x
    for i in (STATES.index(name) for name in watched):
        error = np.abs(moved[:, i] - np.array(foreseen)[:, i]).max()
        assert error < 0.03 * np.abs(moved[:, i]).max()


def damped(t, omega, damping, cosine, sine, level):
    turning = omega * math.sqrt(max(1.0 - damping**2, 1e-9))
    return np.exp(-damping * omega * t) * (cosine * np.cos(turning * t) + sine * np.sin(turning * t)) + level


def test_dutch_roll_frequency_and_damping_are_those_of_a_flight(flown):
    """A damped sine fitted to the sideslip after a kick, once the roll has died out: both within 3 %."""
    model, linear, by_name = flown
    t, moved = response(model, linear, kicked(v=0.2), 3.0)
    late = t > 8.0 / by_name["roll"].omega_rad_s
    mode = by_name["dutch_roll"]
    guess = (mode.omega_rad_s * 1.1, mode.damping * 0.8, 0.2, 0.0, 0.0)
    (omega, damping, *_), _ = curve_fit(damped, t[late][::4], moved[late, 1][::4], guess)
    assert omega == pytest.approx(mode.omega_rad_s, rel=0.03)
    assert abs(damping) == pytest.approx(mode.damping, rel=0.03)


def test_phugoid_frequency_and_damping_are_those_of_a_flight(flown):
    """A damped sine fitted to the speed over two periods after a kick of 0.2 m/s: both within 5 %."""
    model, linear, by_name = flown
    mode = by_name["phugoid"]
    t, moved = response(model, linear, kicked(u=0.2), 2.0 * mode.period_s)
    late = t > 0.5
    guess = (mode.omega_rad_s * 1.1, mode.damping * 0.8, 0.2, 0.0, 0.0)
    (omega, damping, *_), _ = curve_fit(damped, t[late][::20], moved[late, 0][::20], guess)
    assert omega == pytest.approx(mode.omega_rad_s, rel=0.05)
    assert damping == pytest.approx(mode.damping, rel=0.05)


# What the formulas leave out: the two-state short period the speed, the roll the rest, the Dutch roll the rolling,
# which matters most with much dihedral.  Usual errors of the books, of the mode: 5, 5, 20 to 30, 20 to 30 %.
WITHIN = {"short_period": 0.10, "roll": 0.10, "phugoid": 0.20, "dutch_roll": 0.30, "spiral": 0.30}


@pytest.mark.parametrize("name", WITHIN)
def test_mode_lies_near_its_textbook_formula(flown, name):
    _, linear, by_name = flown
    formula = textbook(linear)[name]
    assert formula.omega_rad_s == pytest.approx(by_name[name].omega_rad_s, rel=WITHIN[name])
    assert formula.damping == pytest.approx(by_name[name].damping, rel=WITHIN[name])


def test_bairstow_and_lanchester_agree_where_pitch_is_stiff_and_thrust_constant():
    """A large aeroplane at constant lift: the quartic's slow pair is Lanchester's phugoid within 2 %."""
    speed, ratio, g = 100.0, 15.0, 9.80665
    A = np.zeros((12, 12))
    u, w, q, pitch = (STATES.index(n) for n in ("u", "w", "q", "pitch"))
    drag = 2.0 * g / speed / ratio
    # Lift g (1 + 2 du / V), drag g / ratio (1 + 2 du / V), a short period stiff beside the phugoid.
    A[u, u], A[u, pitch] = -drag, -g
    A[w, u], A[w, w], A[w, q] = -2.0 * g / speed, -1.0, speed
    A[q, w], A[q, q] = -40.0 / speed, -2.0
    A[pitch, q] = 1.0
    A[ASYMMETRIC, ASYMMETRIC] = -1.0  # anything
    linear = LinearModel(A, np.zeros((12, 4)), Trim(speed, 0.0, 0.0, 0.0), np.zeros(12), Trim(speed, 0, 0, 0).command)
    exact, simple = textbook(linear)["phugoid"], lanchester(speed, ratio)
    roots = np.linalg.eigvals(A[np.ix_(SYMMETRIC, SYMMETRIC)])
    slow = roots[np.argsort(np.abs(roots))[0]]
    assert exact.omega_rad_s == pytest.approx(abs(slow), rel=1e-3)
    assert exact.damping == pytest.approx(-slow.real / abs(slow), rel=2e-2)
    # Pitch damping slows the phugoid by 1 + M_q Z_w / (V M_w) = 1.05 in the square.
    assert exact.omega_rad_s * math.sqrt(1.05) == pytest.approx(simple.omega_rad_s, rel=0.02)


def test_modes_of_a_made_up_model_are_told_apart():
    """Known roots, turned into states of mixed units, come back under their names."""
    slow, fast, dutch = -0.05 + 0.4j, -6.0 + 5.0j, -0.8 + 3.0j
    A = np.zeros((12, 12))
    blocks = {SYMMETRIC: (fast, slow), ASYMMETRIC: (dutch, None)}
    rng = np.random.default_rng(0)
    for states, (first, second) in blocks.items():
        D = np.zeros((4, 4))
        D[:2, :2] = [[first.real, first.imag], [-first.imag, first.real]]
        if second is not None:
            D[2:, 2:] = [[second.real, second.imag], [-second.imag, second.real]]
            T = np.array([[0, 0, 1, 0.2], [1, 0, 0.1, 0], [0, 1, 0, 0.1], [0, 0, 0.1, 1]])  # u w q pitch
        else:
            D[2, 2], D[3, 3] = -12.0, 0.03
            T = np.array([[1, 0, 0, 0], [0.1, 0.1, 1, 0], [0, 1, 0, 0.1], [0.1, 0, 0.1, 1]])  # v p r roll
        T = np.diag([30.0, 2.0, 1.0, 0.1]) @ (T + 0.02 * rng.standard_normal((4, 4)))
        A[np.ix_(states, states)] = T @ D @ np.linalg.inv(T)
    A[HEIGHT, HEIGHT] = -1e-4
    x, t = np.zeros(12), Trim(10.0, 0.0, 0.0, 0.0)
    found = {m.name: m for m in modes(LinearModel(A, np.zeros((12, 4)), t, x, t.command))}
    assert set(found) == {"short_period", "phugoid", "dutch_roll", "roll", "spiral"}
    for name, root in (("short_period", fast), ("phugoid", slow), ("dutch_roll", dutch)):
        assert found[name].omega_rad_s == pytest.approx(abs(root), rel=1e-9)
        assert found[name].damping == pytest.approx(-root.real / abs(root), rel=1e-9)
        assert found[name].period_s == pytest.approx(2.0 * math.pi / root.imag, rel=1e-9)
    assert found["roll"].time_to_half_s == pytest.approx(math.log(2.0) / 12.0, rel=1e-9)
    assert found["spiral"].time_to_double_s == pytest.approx(math.log(2.0) / 0.03, rel=1e-9)
    assert math.isinf(found["spiral"].time_to_half_s)
    assert found["spiral"].damping == -1.0


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_written_into_the_model(name):
    """Pitch damping and lift of pitching, constants of the XML, come back out of a glide's motion to 1e-4."""
    model = Model(name, FINE_HZ)  # gliding: the slipstream adds to the damping of the tailplane
    glide = trim(model, model.airframe["cruise"]["airspeed_m_s"], HEIGHT_M, throttle=0.0)
    linear = linearise(model, glide, HEIGHT_M)
    text = (model.folder / f"{model.folder.name}.xml").read_text()
    found = coefficients(linear, Airframe.of(model, linear))
    for function, coefficient in (("moment/pitch-q", "Cm_q"), ("force/lift-q", "CL_q")):
        block = text.split(f'<function name="aero/{function}">')[1].split("</function>")[0]
        written = float(block.split("<value>")[1].split("</value>")[0])
        assert found[coefficient] == pytest.approx(written, rel=1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_the_forces_and_moments(name):
    """A little more and less of an angle or a control at the same speed; lift turns with the wind."""
    model, h = Model(name, FINE_HZ), 1e-3
    glide = trim(model, model.airframe["cruise"]["airspeed_m_s"], HEIGHT_M, throttle=0.0)
    linear = linearise(model, glide, HEIGHT_M)
    frame = Airframe.of(model, linear)
    found, c, s = coefficients(linear, frame), math.cos(glide.alpha_rad), math.sin(glide.alpha_rad)

    def loads(t):
        """Lift and side force over q S; moments about the stability axes of the glide over q S x span or chord."""
        gravity_b = G_M_S2 * np.array([-math.sin(t.pitch_rad), 0.0, math.cos(t.pitch_rad)])
        a = accelerations(model, t, HEIGHT_M)
        x, side, z = frame.mass_kg * (a[:3] - gravity_b)
        lift = x * math.sin(t.alpha_rad) - z * math.cos(t.alpha_rad)
        roll, pitch, yaw = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) @ frame.inertia_kg_m2 @ a[3:6]
        of_span, of_chord = 1.0 / frame.span_m, 1.0 / frame.chord_m
        return np.array([lift, side, roll * of_span, pitch * of_chord, yaw * of_span]) / frame.pressure_force_n

    for by, names in {
        "alpha_rad": {0: "CL_alpha", 3: "Cm_alpha"},
        "beta_rad": {1: "CY_beta", 2: "Cl_beta", 4: "Cn_beta"},
        "aileron": {2: "Cl_aileron", 4: "Cn_aileron"},
        "elevator": {0: "CL_elevator", 3: "Cm_elevator"},
        "rudder": {2: "Cl_rudder", 4: "Cn_rudder"},
    }.items():
        less, more = (loads(replace(glide, **{by: getattr(glide, by) + d})) for d in (-h, h))
        slopes = (more - less) / (2.0 * h)
        for i, coefficient in names.items():  # the drag alone is 1 % of the slope of the lift
            assert found[coefficient] == pytest.approx(slopes[i], rel=2e-3, abs=1e-5), coefficient


@pytest.mark.parametrize("name", NAMES)
def test_performance_is_consistent_with_its_polar(name):
    """No glide of the polar is slower than the stall, flatter than the best glide or sinks less than the least."""
    p = measure(Model(name, 200), HEIGHT_M)
    assert p.stall.airspeed_m_s <= min(t.airspeed_m_s for t in p.polar)
    assert p.best_glide.climb_rad >= max(t.climb_rad for t in p.polar)
    assert p.min_sink.climb_m_s >= max(t.climb_m_s for t in p.polar)
    assert p.stall.airspeed_m_s < p.min_sink.airspeed_m_s < p.best_glide.airspeed_m_s
    # The tangent from the origin touches the polar at the best glide: the slope there is the ratio itself.
    flown = trim(Model(name, 200), 1.01 * p.best_glide.airspeed_m_s, HEIGHT_M, throttle=0.0, guess=p.best_glide)
    assert flown.climb_rad < p.best_glide.climb_rad
    assert len(p.turns) >= 2


def test_full_throttle_meets_level_flight_at_top_speed():
    """The climb at full throttle shrinks to nothing at the top speed, and is greatest at the best climb."""
    model = Model("endurance", 200)
    p = measure(model, HEIGHT_M)
    at_top = trim(model, p.top_speed.airspeed_m_s, HEIGHT_M, throttle=1.0)
    assert at_top.climb_rad == pytest.approx(0.0, rel=0, abs=1e-6)
    assert p.best_climb.climb_m_s >= max(t.climb_m_s for t in p.climbs)
    for faster in (0.98, 1.02):
        beside = trim(model, faster * p.best_climb.airspeed_m_s, HEIGHT_M, throttle=1.0)
        assert beside.climb_m_s < p.best_climb.climb_m_s
    assert replace(p.top_speed, throttle=1.0) == p.top_speed
