# %% [markdown]
# # Which IMU for a tunnel of 60 s?
#
# What each of three IMUs makes of an outage, and which figures an IMU must have to stay within 20 m.

# %%
import matplotlib.pyplot as plt
import nav_sim
import numpy as np

drive = nav_sim.Trajectory("trajectories/land_vehicle.toml")
models = {
    "tactical": nav_sim.Model.read("calib_data/tactical.toml"),
    "consumer": nav_sim.Model.read("calib_data/consumer_mems.toml"),
}
# a tactical one whose gyroscopes are ten times as noisy
gyro = [
    {**p, **{k: 100.0 * v for k, v in p.items() if k in ("sigma2", "gamma2", "q2")}}
    for p in models["tactical"].processes["gyro.x"]
]
models["noisy gyroscopes"] = nav_sim.Model(
    models["tactical"].rate_hz, accel=models["tactical"].processes["accel.x"], gyro=gyro
)

# %% [markdown]
# ASEE (what a filter believes of its own error) and the 95 % quantile of the horizontal error against the outage's
# length: a row an IMU and length, for `pandas.DataFrame(table)`.

# %%
rows = []
for name, model in models.items():
    for length_s in (10.0, 20.0, 40.0, 60.0):
        end = nav_sim.lincov(drive, model, outages=[(300.0, 300.0 + length_s)]).outages
        asee_m = float(np.hypot(end["asee_end_pos_n_m"][0], end["asee_end_pos_e_m"][0]))
        rows.append((name, length_s, asee_m, float(end["horizontal_error_end_m_p95"][0])))
table = dict(zip(("imu", "outage_s", "asee_m", "p95_m"), map(np.array, zip(*rows))))
for row in rows:
    print("{:18} {:4.0f} s   ASEE {:8.2f} m   p95 {:8.2f} m".format(*row))

# %%
figure, ax = plt.subplots()
for name in models:
    own = table["imu"] == name
    ax.loglog(table["outage_s"][own], table["p95_m"][own], "o-", label=name)
ax.axhline(20.0, color="0.5", linestyle="--")
ax.set_xlabel("outage (s)")
ax.set_ylabel("horizontal error, 95 % (m)")
ax.legend()

# %% [markdown]
# The IMU that 20 m need, and whether one of ours is it.

# %%
needed = nav_sim.require(drive, outage=(300.0, 360.0), limits="p95_m<=20")
print(needed.summary())
given = nav_sim.require(drive, models["tactical"], outage=(300.0, 360.0), limits="p95_m<=20")
print(given.summary())
print("met" if given.unmet is None else given.unmet)
plt.show()
