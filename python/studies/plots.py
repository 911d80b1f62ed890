"""Plots of a study as SVG files."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from calibration import ELLIPSOIDS, EVENTS, bins, contents, predictions, stated
from rows import GROUP, published
from summaries import METRICS, interval, mean, shown, values

DEVIATIONS = ["PE cm", "OE °", "|ΔCA| cm²", "|ΔIV| cm³"]


def panels(title, count=4):
    figure, axes = plt.subplots(-(-count // 2), 2, figsize=(11, 3.6 * -(-count // 2)), layout="constrained")
    figure.suptitle(title)
    return figure, axes.flat


def means(group):
    """Means with intervals as bars; circles are published."""
    study, _, level = group[GROUP].iloc[0]
    rows = [(label, found) for label, found in group.groupby("label", sort=False) if label != "truth"][::-1]
    figure, axes = panels("mean, line: 95 % confidence, circle: published")
    for axis, metric in zip(axes, DEVIATIONS, strict=True):
        for place, (label, found) in enumerate(rows):
            known = values(found, METRICS[metric]).to_numpy()
            if len(known):
                axis.barh(place, known.mean(), color="0.7" if label == "initial" else "tab:blue")
                axis.plot(interval(mean, known), [place, place], color="black")
            theirs = published(study, level, label)
            if metric in theirs:
                axis.plot(theirs[metric], place, "o", mfc="none", color="tab:red")
        axis.set(xlabel=metric, yticks=range(len(rows)), yticklabels=[label for label, _ in rows])
    return figure


def cumulative(group):
    """Share of frames below an error."""
    figure, axes = panels("share of frames below an error")
    for axis, metric in zip(axes, DEVIATIONS, strict=True):
        for label, found in group[group["method"] != "truth"].groupby("label", sort=False):
            known = np.sort(values(found, METRICS[metric]).to_numpy())
            frames = found["frames"].max()
            axis.step(known, 100.0 * np.arange(1, len(known) + 1) / frames, where="post", label=label)
        axis.set(xlabel=metric, ylabel="% of frames", xscale="log", ylim=(0, 100))
    axes[0].legend()
    return figure


def steps(group):
    """Means over the number of steps."""
    metrics = ["PE cm", "OE °", "CA cm²", "IV cm³"]
    figure, axes = panels("mean and 95 % confidence over the number of steps")
    for axis, metric in zip(axes, metrics, strict=True):
        found = group[group["steps"].notna() | (group["method"] == "initial")].fillna({"steps": 0})
        for count, rows in found.groupby("steps"):
            known = values(rows, METRICS[metric]).to_numpy()
            if len(known):
                axis.plot(count, known.mean(), "o", color="tab:blue")
                axis.plot([count, count], interval(mean, known), color="tab:blue")
        axis.set(xlabel="steps", ylabel=metric)
    return figure


def faults(group):
    """Mean and median errors over the amount of a fault, of one sweep."""
    sweep = group["sweep"].iloc[0]
    panel = [(metric, statistic) for statistic in ("mean", "median") for metric in DEVIATIONS[:2]]
    figure, axes = panels(sweep)
    for axis, (metric, statistic) in zip(axes, panel, strict=True):
        for method, rows in group.groupby("method", sort=False):
            found = rows.groupby("amount")[METRICS[metric]].agg(statistic)
            lacking = int((rows["status"] != "ok").sum())
            axis.plot(found.index, found, "o-", label=method + (f" ({lacking} failed)" if lacking else ""))
        axis.set(xlabel=f"amount of {sweep}", ylabel=f"{statistic} {metric}", ylim=(0, None))
    axes[0].legend()
    return figure


def reliability(rows):
    """Observed frequencies over predicted probabilities, and shares of true poses within ellipsoids over their nominal content."""
    figure, (left, right) = panels("reliability", 2)
    for event in EVENTS:
        _, predicted, frequency = bins(*predictions(rows, event))
        left.plot(predicted, frequency, "o-", label=event)
    left.set(xlabel="predicted probability", ylabel="observed frequency")
    nominal = np.linspace(0, 1, 101)
    for ellipsoid in ELLIPSOIDS:
        right.plot(nominal, [(contents(rows, ellipsoid) <= content).mean() for content in nominal], label=ellipsoid)
    right.set(xlabel="nominal content of the ellipsoid", ylabel="share of true poses within")
    for axis in (left, right):
        axis.plot([0, 1], [0, 1], ":", color="0.5")
        axis.legend()
    return figure


def roc_curve(rows):
    """False and true positive rates of failures by falling probability of being within 5 mm and 5°."""
    probability, occurred = predictions(rows, "5 mm and 5°")
    thresholds = np.unique(probability)
    rates = [[(probability[occurred == outcome] <= t).mean() for t in thresholds] for outcome in (1.0, 0.0)]
    return np.column_stack([[0.0, 0.0], rates])


def roc(rows):
    """Receiver operating characteristic of failures."""
    figure, axis = plt.subplots(figsize=(5, 5), layout="constrained")
    axis.plot(*roc_curve(rows), drawstyle="steps-post")
    axis.plot([0, 1], [0, 1], ":", color="0.5")
    axis.set(xlabel="share of right poses below the threshold", ylabel="share of wrong poses below the threshold")
    return figure


def plots(rows):
    """Names and figures of all plots."""
    for (study, dataset, level), group in rows[rows["study"] != "half_turns"].groupby(GROUP, sort=False):
        name = f"{study}-{dataset}-{level}"
        if study == "robustness":
            for sweep, found in group.groupby("sweep", sort=False):
                yield f"{name}-{sweep}", faults(found)
            continue
        if shown(group, METRICS):
            yield f"{name}-means", means(group)
            yield f"{name}-cumulative", cumulative(group)
        if study == "steps":
            yield f"{name}-steps", steps(group)
    for title, found in stated(rows):
        name = title.replace(", ", "-").replace(" ", "-")
        yield f"{name}-reliability", reliability(found)
        if 0 < found["right"].sum() < len(found):
            yield f"{name}-roc", roc(found)
