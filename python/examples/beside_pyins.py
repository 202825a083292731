# %% [markdown]
# # Beside pyins
#
# The covariance of the filter of [pyins](https://github.com/nmayorov/pyins) (`pip install python-ins`) and that of
# nav-sim's covariance analysis on one drive of 900 s with two outages: the same IMU, receiver and start. pyins' filter runs
# on samples without errors, so that it linearises along the true path, as covariance analysis does.

# %%
import time

import matplotlib.pyplot as plt
import nav_sim
import numpy as np
import numpy.typing as npt
import pandas as pd
import pyins.filters
import pyins.inertial_sensor
import pyins.measurements
import pyins.sim
import pyins.strapdown

RATE_HZ = 100.0
OUTAGES = [(300.0, 390.0), (700.0, 790.0)]
# root densities of white noise, random walks of the biases, biases at the start: gyroscope (rad/s), accelerometer (m/s²)
GYRO = {"noise": 1.2e-5, "walk": 5e-8, "bias": 5e-6}
ACCEL = {"noise": 5e-4, "walk": 4e-6, "bias": 2e-3}
POSITION_M, VELOCITY_M_S, LEVEL_DEG, HEADING_DEG = 2.0, 0.05, 0.5, 2.0

# %% [markdown]
# nav-sim. White noise of a root density N has the variance N² times the rate in each sample, a random walk of density K
# grows by K² over the rate.


# %%
def processes(sensor: dict[str, float]) -> list[dict[str, float | str]]:
    """White noise and random walk, per sample."""
    return [
        {"type": "WN", "sigma2": sensor["noise"] ** 2 * RATE_HZ},
        {"type": "RW", "gamma2": sensor["walk"] ** 2 / RATE_HZ},
    ]


drive = nav_sim.Trajectory("trajectories/figure_eight.toml")
model = nav_sim.Model(RATE_HZ, accel=processes(ACCEL), gyro=processes(GYRO))
sigmas = {"pos_sigma_m": [POSITION_M] * 3, "vel_sigma_m_s": [VELOCITY_M_S] * 3}
scenario = {"gnss": {"rate_hz": 1.0, **sigmas}, "initial": {**sigmas, "att_sigma_deg": [LEVEL_DEG, LEVEL_DEG, HEADING_DEG]}}
began = time.process_time()
own = nav_sim.lincov(
    drive, model, outages=OUTAGES, turn_on_bias=(ACCEL["bias"], GYRO["bias"]), scenario=scenario
).epochs
own_s = time.process_time() - began

# %% [markdown]
# pyins, with fixes at the same instants.

# %%
states = drive.states(RATE_HZ)


def of_states(*names: str) -> npt.NDArray[np.float64]:
    return np.stack([states[name] for name in names], axis=1)


lla, rph = of_states("lat_deg", "lon_deg", "h_m"), of_states("roll_deg", "pitch_deg", "yaw_deg")
truth, imu = pyins.sim.generate_imu(
    states["t_s"], lla, rph, of_states("v_n_m_s", "v_e_m_s", "v_d_m_s"), sensor_type="increment"
)
increments = pyins.strapdown.compute_increments_from_imu(imu, "increment")
at_s = own["t_s"][(own["gnss"] > 0) & (own["t_s"] > 0.0)]
fixes = truth.iloc[np.round(at_s * RATE_HZ).astype(int)]
sensors = {
    name: pyins.inertial_sensor.EstimationModel(bias_sd=own["bias"], noise=own["noise"], bias_walk=own["walk"])
    for name, own in (("gyro_model", GYRO), ("accel_model", ACCEL))
}
began = time.process_time()
theirs = pyins.filters.run_feedback_filter(
    truth.iloc[0],
    POSITION_M,
    VELOCITY_M_S,
    LEVEL_DEG,
    HEADING_DEG,
    increments,
    **sensors,
    measurements=[
        pyins.measurements.Position(fixes, POSITION_M),
        pyins.measurements.NedVelocity(fixes, VELOCITY_M_S),
    ],
).trajectory_sd
theirs_s = time.process_time() - began

# %% [markdown]
# Standard deviations epoch by epoch, and what they differ by at most and at the end of the outages.

# %%
COLUMNS = {
    "pos_n_m": "north", "pos_e_m": "east", "pos_d_m": "down", "vel_n_m_s": "VN", "vel_e_m_s": "VE", "vel_d_m_s": "VD",
    "roll_deg": "roll", "pitch_deg": "pitch", "yaw_deg": "heading",
}  # fmt: skip
instants = np.asarray(theirs.index)
# after the fix, as `epochs` has them; the last epoch is after the last step of pyins
epochs = [k for k, t_s in enumerate(own["t_s"]) if np.min(np.abs(instants - t_s)) < 1e-6]
rows = [int(np.argmin(np.abs(instants - own["t_s"][k]))) for k in epochs]
table = pd.DataFrame(
    {name: own[f"asee_{name}"][epochs] / theirs[column].to_numpy()[rows] - 1.0 for name, column in COLUMNS.items()},
    index=own["t_s"][epochs],
)
print(f"processor time: nav-sim {own_s:.1f} s, pyins {theirs_s:.1f} s")
print("largest difference of the standard deviations (%):")
print((100.0 * table.abs().max()).round(3).to_string())
for _, end_s in OUTAGES:
    last = table.index[table.index < end_s][-1]
    print(f"at {last:g} s, before the fix (%):", (100.0 * table.loc[last]).round(3).to_dict())

# %%
figure, ax = plt.subplots()
ax.semilogy(own["t_s"], own["asee_horizontal_m"], label="nav-sim")
ax.semilogy(instants, np.hypot(theirs["north"], theirs["east"]), "--", label="pyins")
ax.set(xlabel="time (s)", ylabel="horizontal standard deviation (m)")
ax.legend()
plt.show()
