"""One JSBSim aeroplane in SI units; the only importer of jsbsim.

Loading, placing, reading and writing; each property name is resolved once.  Feet and pounds occur only here and in
the kernel of `sim.aeroplane.jsbsim_plant` that converts a tick to SI.
"""

import math
import tomllib
from collections.abc import Callable
from typing import Any

import jsbsim
import numpy as np

from autopilot.interface import ActuatorCommand
from estimator.interface import Array
from sim.aeroplane.built import AIRCRAFT, AS_DRAWN, AsBuilt, model_folder
from sim.air import Air
from sim.place import LAUNCH_PLACE, Place, wrapped_deg
from sim.truth import EARTH_RATE_RAD_S

FT_TO_M = 0.3048
LB_TO_N = 4.4482216152605
LBFT_TO_NM = LB_TO_N * FT_TO_M
SLUG_TO_KG = LB_TO_N / FT_TO_M
SLUGFT2_TO_KGM2 = SLUG_TO_KG * FT_TO_M**2

WRITE = ("fcs/aileron-cmd-norm", "fcs/elevator-cmd-norm", "fcs/rudder-cmd-norm", "fcs/throttle-cmd-norm")
WIND = tuple(f"atmosphere/wind-{d}-fps" for d in ("north", "east", "down"))
INTEGRATORS = tuple(f"simulation/integrator/{a}" for a in (
    "rate/rotational", "rate/translational", "position/rotational", "position/translational",
))  # fmt: skip


class _Silent(jsbsim.FGLogger):
    """Discards JSBSim's console output."""

    def message(self, _text: str) -> None:
        return


_SILENT = _Silent()


def _offset(write: Callable[[float], None], off: float) -> Callable[[float], None]:
    return lambda value: write(value + off)


class Model:
    """One JSBSim aeroplane in SI units, at a launch place: loading, placing, wind."""

    def __init__(self, aircraft: str, physics_hz: int, built: AsBuilt = AS_DRAWN, site: Place = LAUNCH_PLACE) -> None:
        self.built, self.site = built, site
        self.folder = AIRCRAFT / aircraft
        known = sorted(p.parent.name for p in AIRCRAFT.glob("*/airframe.toml"))
        if aircraft not in known:
            raise ValueError(f"unknown aircraft '{aircraft}': choose {', '.join(known)}")
        self.airframe: dict[str, Any] = tomllib.loads((self.folder / "airframe.toml").read_text())
        self.dt_s = 1.0 / physics_hz
        jsbsim.set_logger(_SILENT)  # for each model: JSBSim keeps a logger per thread
        self.fdm = jsbsim.FGFDMExec(str(self.folder))  # not its own data, absent in some installations
        self.fdm.set_dt(self.dt_s)  # before loading, which computes the servo lags
        with model_folder(self.folder, built) as (models, engine):
            if not self.fdm.load_model_with_paths(aircraft, models, engine, str(self.folder)):
                raise RuntimeError(f"JSBSim could not load the aircraft '{aircraft}'")
        self.run = self.fdm.run
        self._properties = self.fdm.get_property_manager()
        self._integrators = [(self.setter(p), self.getter(p)()) for p in INTEGRATORS]

    def _node(self, name: str) -> Any:
        node = self._properties.get_node(name)
        if node is None:
            raise ValueError(f"JSBSim has no property '{name}' in the aircraft '{self.folder.name}'")
        return node

    def getter(self, name: str) -> Callable[[], float]:
        """Bound method that reads the property `name`, in JSBSim's unit."""
        return self._node(name).get_double_value  # type: ignore[no-any-return]

    def setter(self, name: str) -> Callable[[float], None]:
        """Bound method that writes the property `name`, in JSBSim's unit."""
        return self._node(name).set_double_value  # type: ignore[no-any-return]

    def servo_setters(self) -> tuple[Callable[[float], None], ...]:
        """Setters of aileron, elevator, rudder and throttle; each surface is off by its trim."""
        aileron, elevator, rudder, throttle = (self.setter(name) for name in WRITE)
        off = zip((aileron, elevator, rudder), self.built.trims, strict=True)
        return (*(_offset(write, trim) if trim else write for write, trim in off), throttle)

    def has(self, name: str) -> bool:
        return self._properties.get_node(name) is not None

    def get(self, *names: str) -> Array:
        return np.array([self.getter(name)() for name in names])

    def put(self, values: dict[str, float]) -> None:
        """Write properties, in JSBSim's units and in the order given."""
        for name, value in values.items():
            self.setter(name)(value)

    def mass_kg(self) -> float:
        return float(self.get("inertia/mass-slugs")[0]) * SLUG_TO_KG

    def inertia_kg_m2(self) -> Array:
        """Principal moments of inertia, shape (3,)."""
        return SLUGFT2_TO_KGM2 * self.get(*(f"inertia/i{a}{a}-slugs_ft2" for a in "xyz"))

    @property
    def powered(self) -> bool:
        """Whether the model has a propeller, and so an advance ratio."""
        return self._properties.get_node("propulsion/engine/advance-ratio") is not None

    def thrust_n(self) -> float:
        """Thrust of the propeller in the last step; 0 without one."""
        return LB_TO_N * float(self.get("propulsion/engine/thrust-lbs")[0]) if self.powered else 0.0

    def inertia_tensor_kg_m2(self) -> Array:
        """Inertia about the centre of gravity, body axes, shape (3, 3), off-diagonal elements negated products.

        JSBSim's properties are the elements: ``inertia/ixz-slugs_ft2`` is the negated product.
        """
        names = ("ixx", "iyy", "izz", "ixy", "iyz", "ixz")
        xx, yy, zz, xy, yz, xz = SLUGFT2_TO_KGM2 * self.get(*(f"inertia/{name}-slugs_ft2" for name in names))
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def wing(self) -> tuple[float, float, float]:
        """Reference quantities of the coefficients: area [m2], span and mean chord [m]."""
        area, span, chord = self.get("metrics/Sw-sqft", "metrics/bw-ft", "metrics/cbarw-ft")
        return area * FT_TO_M**2, span * FT_TO_M, chord * FT_TO_M

    def density_kg_m3(self) -> float:
        """Air density at the aeroplane."""
        return float(self.get("atmosphere/rho-slugs_ft3")[0]) * SLUG_TO_KG / FT_TO_M**3

    def force_and_moment(self) -> tuple[Array, Array]:
        """All forces except gravity [N] and all moments [N m] on the body in the last step, body axes."""
        force = LB_TO_N * self.get(*(f"forces/fb{a}-total-lbs" for a in "xyz"))
        return force, LBFT_TO_NM * self.get(*(f"moments/{a}-total-lbsft" for a in "lmn"))

    def accelerations(self) -> Array:
        """Rates of change of the body velocity [m/s2] and of the body rates [rad/s2], shape (6,)."""
        linear = FT_TO_M * self.get(*(f"accelerations/{a}dot-ft_sec2" for a in "uvw"))
        return np.concatenate([linear, self.get(*(f"accelerations/{a}dot-rad_sec2" for a in "pqr"))])

    def coming_rates(self) -> Array:
        """Body rates [rad/s] after the next step, as computed by the last one."""
        rates = self.get(*(f"velocities/{a}-rad_sec" for a in "pqr"))
        return rates + self.dt_s * self.accelerations()[3:]

    def place(
        self, height_m: float, euler_rad: tuple[float, float, float], v_b_m_s: Array,
        omega_b_rad_s: tuple[float, float, float], command: ActuatorCommand, air: Air, settle: int,
        ground_m: float = 0.0,
    ) -> None:  # fmt: skip
        """Restart above the launch point: velocity over the ground in body axes, servos at `command`, mean wind.

        height_m : above the launch point      ground_m : height of the ground there, relative to the launch point

        Then the motion is frozen for `settle` steps (at least 1) while the propeller speed settles.
        """
        # Frozen motion is at rest in inertial space: the earth turns below it, up to the launch point.
        ahead_deg = math.degrees(EARTH_RATE_RAD_S * settle * self.dt_s)
        longitude_deg = float(wrapped_deg(self.site.longitude_deg + ahead_deg))
        self.put({"ic/lat-geod-deg": self.site.latitude_deg, "ic/long-gc-deg": longitude_deg})
        self.put({"ic/terrain-elevation-ft": (self.site.elevation_m + ground_m) / FT_TO_M})
        self.put({"ic/h-agl-ft": (height_m - ground_m) / FT_TO_M})
        self.put(dict(zip(("ic/phi-rad", "ic/theta-rad", "ic/psi-true-rad"), euler_rad, strict=True)))
        self.put({f"ic/{a}-fps": float(v) / FT_TO_M for a, v in zip("uvw", v_b_m_s, strict=True)})
        self.put({f"ic/{a}-rad_sec": w for a, w in zip("pqr", omega_b_rad_s, strict=True)})
        self.put({"atmosphere/turb-type": 0.0})  # not JSBSim's: referred to sea level, and wrong in oblique winds
        self.push(np.zeros(3), np.zeros(3))
        self.fdm.run_ic()  # resets commands and wind
        self.put(dict(zip(WRITE, self.built.servos(command)[:4], strict=True)))
        wind_e = air.mean_wind_e_m_s(height_m - ground_m)
        self.put({name: float(w) / FT_TO_M for name, w in zip(WIND, wind_e, strict=True)})
        self.fdm.set_trim_status(True)  # servos jump to their commands
        self.frozen(1)
        self.fdm.set_trim_status(False)
        self.frozen(settle - 1)

    def frozen(self, steps: int) -> None:
        """Run `steps` with the motion frozen; forces, servos and propeller continue."""
        for write, _ in self._integrators:
            write(0.0)
        for _ in range(steps):
            self.run()
        for write, scheme in self._integrators:
            write(scheme)

    def settle(self) -> None:
        """Freeze the motion until the propeller turns steadily at the current command and airspeed.

        A step of length dt changes its speed from n to n + dt f(n).  With dt = -1 / f'(n), the slope taken from the
        two steps before, that is a Newton step towards f = 0: ten of them replace seconds of simulated time.
        """
        if self.powered:
            rpm = self.getter("propulsion/engine/propeller-rpm")
            now, before, slowing, dt_s = rpm(), math.nan, math.nan, 0.03
            for _ in range(60):
                self.fdm.set_dt(dt_s)
                self.frozen(1)
                change = rpm() - now
                if abs(change) < 1e-12 * abs(now) or rpm() < 1e-3:
                    break
                slope = (change / dt_s - slowing) / (now - before) if now != before else math.nan
                slowing, before, now = change / dt_s, now, rpm()
                dt_s = min(0.2, max(0.005, -1.0 / slope)) if slope < 0.0 else 0.03
            self.fdm.set_dt(self.dt_s)
        self.frozen(2)  # values of the previous step are now those of a steady propeller

    def remember(self, on: bool) -> None:
        """Off: integrate the velocity without past accelerations, which would smear a step of the force."""
        write, scheme = self._integrators[1]
        write(scheme if on else 1.0)

    def push(self, force_b_n: Array, moment_b_nm: Array) -> None:
        """Set the force and the moment of the hand, body axes, until set again."""
        hand_force, moment = "external_reactions/hand", "external_reactions/hand_moment"
        self.put({f"{hand_force}/{a}": float(f) / LB_TO_N for a, f in zip("xyz", force_b_n, strict=True)})
        self.put({f"{moment}/{a}": float(m) / LBFT_TO_NM for a, m in zip("lmn", moment_b_nm, strict=True)})
        self.put({f"{hand_force}/magnitude": 1.0, f"{moment}/magnitude-lbsft": 1.0})
