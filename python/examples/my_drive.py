# %% [markdown]
# # My drive
#
# Recorded IMU and GNSS data through the filter: arrays, data frames or files. The drive here is simulated by the
# command, and the model is one of the IMU's class.

# %%
import csv
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import nav_sim
import numpy as np
import numpy.typing as npt

place = Path(tempfile.mkdtemp()) / "drive"
words = [
    "trajectory",
    "record",
    "trajectories/figure_eight.toml",
    "calib_data/tactical.toml",
    "--seed",
    "1",
    "-o",
    str(place),
]
subprocess.run([sys.executable, "-m", "nav_sim", *words], check=True)


def columns(path: Path) -> dict[str, npt.NDArray[np.float64]]:
    """A table as columns; `pandas.read_csv` and `polars.read_csv` do it too."""
    with open(path, encoding="utf-8") as file:
        head, *rows = csv.reader(line for line in file if not line.startswith("#"))
    return dict(zip(head, np.array(rows, dtype=np.float64).T))


imu, gnss = columns(place / "imu.csv"), columns(place / "gnss.csv")
print(list(imu), list(gnss))

# %% [markdown]
# The solution, with a window in which fixes are withheld: its end says what the filter is worth.

# %%
drive = nav_sim.fuse(
    imu, gnss, "calib_data/tactical.toml", reference=place / "reference.csv", outages=[(100.0, 130.0)], smooth=True
)
print(drive.summary())
drive.plot()

# %%
figure, ax = plt.subplots()
error_m = np.hypot(drive.errors["err_pos_n_m"], drive.errors["err_pos_e_m"])
ax.semilogy(drive.errors["t_s"], error_m, label="error")
ax.semilogy(
    drive.solution["t_s"], 2.0 * np.hypot(drive.solution["sd_n_m"], drive.solution["sd_e_m"]), label="2 σ believed"
)
ax.set_xlabel("time (s)")
ax.set_ylabel("horizontal (m)")
ax.legend()

# %% [markdown]
# One's own trajectory, simulated: the drift after 60 s without fixes.

# %%
mine = {name: drive.smoothed[name] for name in ("t_s", "lat_deg", "lon_deg", "h_m", "roll_deg", "pitch_deg", "yaw_deg")}
run = nav_sim.run(mine, "calib_data/consumer_mems.toml", outages=[(60.0, 120.0)], runs=8)
print(f"after 60 s: {run.outages['horizontal_error_end_m_p50'][0]:.0f} m (median)")
plt.show()
