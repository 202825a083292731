# %% [markdown]
# # Table I, Figures 2 and 7 of Minaretzis et al. 2024
#
# A virtual IMU is calibrated from clean recordings (I), from corrupted ones (II), and from corrupted ones of which two
# are abnormal (III); its models navigate a drive of 15 minutes with two outages. `SAMPLES` and `SETS` are small here,
# so that it takes a minute, and single figures differ from the paper's; at its size they are 524284 and 500.

# %%
import matplotlib.pyplot as plt
import nav_sim
import numpy as np
import numpy.typing as npt

SAMPLES, SETS = 60_000, 6
SCENARIOS = {"I": None, "II": "section5-II", "III": "section5-III"}
ESTIMATORS = ("awv", "sr-awv", "dr-awv")
imu = nav_sim.Model.read("calib_data/consumer_mems.toml")


def recordings(model: nav_sim.Model, contaminate: str | None, seed: int) -> list[dict[str, npt.NDArray[np.float64]]]:
    """Eight replicates of one axis of each sensor."""
    made = (
        model.synthesize(samples=SAMPLES, replicate=k, seed=seed, spread=True, contaminate=contaminate)
        for k in range(1, 9)
    )
    return [{name: x for name, x in one.items() if "_x_" in name} for one in made]


# %% [markdown]
# Three estimators in three scenarios: nine models, and the ASEE of the filter that has each of them, by covariance
# analysis.

# %%
runs = {}
for scenario, contaminate in SCENARIOS.items():
    fit = nav_sim.calibrate(recordings(imu, contaminate, 1), rate_hz=100.0, estimator="all", bootstrap=0)
    for estimator, model in fit.models.items():
        # the other axes of the sensors are taken to be as the one that was recorded
        x = model.processes
        alike = nav_sim.Model(model.rate_hz, accel=x["accel.x"], gyro=x["gyro.x"])
        runs[scenario, estimator] = nav_sim.lincov("trajectories/land_vehicle.toml", alike, truth=imu, filter="full")

# %% [markdown]
# Table I: (ASEE over that of AWV in scenario I − 1) · 100, the mean over each outage.

# %%
reference = runs["I", "awv"].outages
print(
    f"{'scenario':10}{'outage':>8}" + "".join(f"{e + ' ' + s:>18}" for s in ("pos_e_m", "roll_deg") for e in ESTIMATORS)
)
for scenario in SCENARIOS:
    for k in range(2):
        ratios = [
            100.0 * (runs[scenario, e].outages[f"asee_mean_{s}"][k] / reference[f"asee_mean_{s}"][k] - 1.0)
            for s in ("pos_e_m", "roll_deg")
            for e in ESTIMATORS
        ]
        print(f"{scenario:10}{k + 1:>8}" + "".join(f"{ratio:18.1f}" for ratio in ratios))

# %% [markdown]
# Figure 7: the same over time.

# %%
figure, axes = plt.subplots(1, 3, sharey=True, figsize=(12, 4))
base = runs["I", "awv"].epochs
for ax, scenario in zip(axes, SCENARIOS):
    for estimator in ESTIMATORS:
        ratio = runs[scenario, estimator].epochs["asee_pos_e_m"] / base["asee_pos_e_m"]
        ax.plot(base["t_s"], 100.0 * (ratio - 1.0), label=estimator)
    ax.set(title=f"scenario {scenario}", xlabel="time (s)")
axes[0].set_ylabel("(ASEE ratio − 1) · 100, east")
axes[0].legend()

# %% [markdown]
# Figure 2: the robust RMSE of each estimator, √(median² + MAD²) of the relative errors over sets of eight recordings
# of an accelerometer (eq. 15 of the paper).

# %%
n1 = nav_sim.Model(
    100.0,
    accel=[
        {"type": "WN", "sigma2": 5e-5},
        {"type": "AR1", "phi": 0.98, "sigma2": 2e-8},
        {"type": "RW", "gamma2": 2e-11},
    ],
)
truth = {(p["type"], name): value for p in n1.processes["accel.x"] for name, value in p.items() if name != "type"}
found: dict[tuple[str, str], list[dict[tuple[str, str], float]]] = {}
for scenario, contaminate in {"I": None, "II": "section4-II", "III": "section4-III"}.items():
    for seed in range(SETS):
        fit = nav_sim.calibrate(
            recordings(n1, contaminate, seed), rate_hz=100.0, estimator="all", model="N1", bootstrap=0
        )
        for estimator in ESTIMATORS:
            processes = fit.models[estimator].processes["accel.x"]
            own = {(p["type"], name): value for p in processes for name, value in p.items() if name != "type"}
            found.setdefault((scenario, estimator), []).append(own)

# %%
figure, axes = plt.subplots(1, len(truth), figsize=(14, 4))
for ax, (parameter, value) in zip(axes, truth.items()):
    for k, estimator in enumerate(ESTIMATORS):
        errors = [np.array([one[parameter] / value - 1.0 for one in found[s, estimator]]) for s in SCENARIOS]
        deviations = [1.4826 * np.median(np.abs(e - np.median(e))) for e in errors]
        rmse = [float(np.hypot(np.median(e), mad)) for e, mad in zip(errors, deviations)]
        ax.semilogy([s + 0.1 * (k - 1) for s in range(3)], rmse, "o", label=estimator)
    ax.set_xticks(range(3), list(SCENARIOS))
    ax.set_title(" ".join(parameter))
axes[0].set_ylabel("robust relative RMSE")
axes[0].legend()
plt.show()
