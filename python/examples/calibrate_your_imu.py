# %% [markdown]
# # Calibrate your IMU
#
# From static recordings to a noise model, and from that to the parameters of a filter. The recordings here are
# simulated, as columns of a dict; a list of your files in their place (CSV, .npy, .npz, ROS bags, PX4 and u-blox logs)
# does as well.

# %%
import matplotlib.pyplot as plt
import nav_sim

imu = nav_sim.Model.read("calib_data/consumer_mems.toml")
recordings = [imu.synthesize(duration_s=300.0, replicate=k, seed=1, spread=True) for k in range(1, 7)]

# %% [markdown]
# The Allan deviation of one signal, classical and robust: where they part, there are outliers.

# %%
gyro_x = recordings[0]["gyro_x_rad_s"]
ax = nav_sim.allan_deviation(gyro_x, rate_hz=100.0).plot(label="classical")
nav_sim.allan_deviation(gyro_x, rate_hz=100.0, robust=True).plot(ax=ax, label="robust")
ax.legend()

# %% [markdown]
# The model of all six recordings, with its intervals.

# %%
fit = nav_sim.calibrate(recordings, rate_hz=100.0, model="AR1+RW+WN+QN")
print(fit.summary())
fit.plot(sensor="gyro")

# %%
for row in zip(
    *(fit.parameters[key] for key in ("sensor", "process", "parameter", "value", "ci_low", "ci_high", "unit"))
):
    print("{:6} {:6} {:7} {:.3g} [{:.3g}, {:.3g}] {}".format(*row))

# %% [markdown]
# What other programs ask for.

# %%
print(fit.model.export("kalibr"))
print(fit.model.practical()["gyro"])
plt.show()
