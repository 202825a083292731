"""IMU noise calibration and INS/GNSS navigation: the engine of the command `nav-sim`, for arrays and files alike.

    import nav_sim
    fit = nav_sim.calibrate(["mon.csv", "tue.csv", "wed.csv"])      # or arrays: see `calibrate`
    print(fit.summary())
    fit.model.write("imu.toml")
    drive = nav_sim.lincov("trajectories/land_vehicle.toml", fit.model, outages=[(300, 390)])
    drive.plot()                                                    # needs nav-sim[plot]

Units are in the names (`gyro_x_rad_s`, `t_s`, `lat_deg`). A result is a dict of NumPy arrays, which `pandas.DataFrame`
and `polars.DataFrame` take, or has such dicts; `.summary()` and `.to_html(path)` are the texts of the command. The
same seed gives the bytes of the command. What cannot be done raises `NavSimError`, what is doubtful warns
`NavSimWarning`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nav_sim._answer import Answer as Answer
    from nav_sim._answer import show_versions as show_versions
    from nav_sim._calibration import Calibration as Calibration
    from nav_sim._calibration import calibrate as calibrate
    from nav_sim._decisions import Choice as Choice
    from nav_sim._decisions import choose as choose
    from nav_sim._decisions import compare as compare
    from nav_sim._decisions import design as design
    from nav_sim._decisions import require as require
    from nav_sim._decisions import tune as tune
    from nav_sim._errors import NavSimError as NavSimError
    from nav_sim._errors import NavSimWarning as NavSimWarning
    from nav_sim._model import Model as Model
    from nav_sim._model import catalogue as catalogue
    from nav_sim._navigation import Fusion as Fusion
    from nav_sim._navigation import Judgement as Judgement
    from nav_sim._navigation import Run as Run
    from nav_sim._navigation import fuse as fuse
    from nav_sim._navigation import judge as judge
    from nav_sim._navigation import lincov as lincov
    from nav_sim._navigation import run as run
    from nav_sim._study import Study as Study
    from nav_sim._study import StudyAnswer as StudyAnswer
    from nav_sim._trajectory import Trajectory as Trajectory
    from nav_sim._wavelet import Curve as Curve
    from nav_sim._wavelet import WaveletVariances as WaveletVariances
    from nav_sim._wavelet import allan_deviation as allan_deviation
    from nav_sim._wavelet import wavelet_variance as wavelet_variance
    from nav_sim._wavelet import wv as wv

# A module is read when a name of it is first used: the command needs none of them, and starts at once.
_HOMES = {
    "_answer": ["Answer", "show_versions"],
    "_calibration": ["Calibration", "calibrate"],
    "_decisions": ["Choice", "choose", "compare", "design", "require", "tune"],
    "_errors": ["NavSimError", "NavSimWarning"],
    "_model": ["Model", "catalogue"],
    "_navigation": ["Fusion", "Judgement", "Run", "fuse", "judge", "lincov", "run"],
    "_study": ["Study", "StudyAnswer"],
    "_trajectory": ["Trajectory"],
    "_wavelet": ["Curve", "WaveletVariances", "allan_deviation", "wavelet_variance", "wv"],
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"nav_sim.{_HOME[name]}"), name)
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("nav-sim")
    raise AttributeError(f"module 'nav_sim' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
