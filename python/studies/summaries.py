"""Means, medians, changes and paired contrasts of a study, with 95 % intervals of resampled frames."""

import numpy as np
import pandas as pd
from rows import GROUP, published
from scipy import stats

METRICS = {
    "PE cm": "pe_cm",
    "OE °": "oe_deg",
    "OEsym °": "oe_symmetric_deg",
    "CA cm²": "ca_cm2",
    "IV cm³": "iv_cm3",
    "|ΔCA| cm²": "delta_ca_cm2",
    "|ΔIV| cm³": "delta_iv_cm3",
}
ERRORS = {name: column for name, column in METRICS.items() if name not in ("CA cm²", "IV cm³")}
"""Metrics of which less is better."""
GIVEN = ("truth", "initial")
REFERENCES = {"evidence": "fused", "steps": None}
"""The method that others are compared with, where it is not the robust ICP."""


def mean(values, axis=-1):
    return values.mean(axis=axis)


def difference(one, other, axis=-1):
    return one.mean(axis=axis) - other.mean(axis=axis)


def ratio(one, other, axis=-1):
    return one.mean(axis=axis) / other.mean(axis=axis)


def change(one, other, axis=-1):
    return 100.0 * (ratio(one, other, axis) - 1.0)


def interval(statistic, *columns):
    """The 95 % interval of a statistic of one or two columns of the same frames: percentile bootstrap, 2000 resamples of the frames."""
    if len(columns[0]) < 2:
        return np.nan, np.nan
    resampled = stats.bootstrap(
        columns, statistic, paired=True, vectorized=True, n_resamples=2000, method="percentile", rng=1
    )
    return tuple(resampled.confidence_interval)


def number(value):
    return f"{value:.3f}" if 5e-4 <= abs(value) < 0.1 else f"{value:.2f}"


def cell(statistic, *columns, show=number):
    """A statistic with its interval; a dash where there is nothing to show."""
    value = statistic(*columns) if len(columns[0]) else np.nan
    if not np.isfinite(value):
        return "-"
    low, high = interval(statistic, *columns)
    return show(value) if np.isnan(low) else f"{show(value)} [{show(low)}, {show(high)}]"


def values(rows, column):
    """A column of rows by frame, as far as it is known."""
    return rows.set_index("frame")[column].dropna()


def paired(rows, others, column):
    """A column of two methods over the frames that both have."""
    both = pd.concat([values(rows, column), values(others, column)], axis=1, join="inner").to_numpy()
    return both[:, 0], both[:, 1]


def shown(rows, metrics):
    """The metrics that any row has."""
    return {name: column for name, column in metrics.items() if column in rows and rows[column].notna().any()}


def lines(group, frames, metrics, figure, paper=None, print_paper=number):
    """A table: a row a label with `figure(rows, column)` by metric, and the published row `paper(label)` below ours."""
    table = []
    for label, rows in group.groupby("label", sort=False):
        found = {name: figure(rows, column) for name, column in metrics.items()}
        if all(text is None for text in found.values()):
            continue
        scored = (rows["status"] == "ok").sum()
        table.append({"row": label, "n": f"{scored}/{frames}", **found})
        theirs = paper(label) if paper else {}
        if len(theirs):
            theirs = {name: print_paper(theirs[name]) if name in theirs else "-" for name in metrics}
            table.append({"row": "· published", "n": "", **theirs})
    return pd.DataFrame(table)


def of_objects(group, metrics, figure):
    """The same of every object."""
    parts = []
    for obj_id, rows in group.groupby("obj_id"):
        part = lines(rows, rows["frame"].nunique(), metrics, figure)
        parts.append(part.assign(row=f"object {obj_id}: " + part["row"]))
    return pd.concat(parts)


def reference_of(group, study, reference):
    """The rows that each label is compared with: those of the reference method under the same fault."""
    reference = reference or REFERENCES.get(study, "robust-icp")
    by_label = dict(list(group.groupby("label")))

    def find(rows):
        method, label = rows[["method", "label"]].iloc[0]
        if reference is None or method in (reference, *GIVEN):
            return None
        return by_label.get(label.replace(method, reference, 1))

    return reference, find


def level_tables(group, reference=None, by_object=False):
    """Titles and tables of the frames of one study, dataset and level."""
    study, dataset, level = group[GROUP].iloc[0]
    frames = int(group["frames"].max())
    initial = group[group["method"] == "initial"]
    metrics, errors = shown(group, METRICS), shown(group, ERRORS)

    def means(rows, column):
        return cell(mean, values(rows, column).to_numpy())

    def medians(rows, column):
        return number(values(rows, column).median())

    def changes(rows, column):
        if rows["method"].iloc[0] in GIVEN:
            return None
        return cell(change, *paired(rows, initial, column), show=lambda value: f"{value:+.1f}")

    def change_of_paper(label):
        before, after = published(study, level, "initial"), published(study, level, label)
        return {} if label in GIVEN or after.empty else 100.0 * (after / before - 1.0)

    title = f"{study} {dataset}, noise {level}"
    yield f"{title}: means over {frames} frames [95 % confidence]", lines(
        group, frames, metrics, means, lambda label: published(study, level, label), lambda value: f"{value:.2f}"
    )
    yield f"{title}: medians", lines(group, frames, metrics, medians)
    yield f"{title}: change of the mean against the initial pose, % [95 % confidence]", lines(
        group, frames, errors, changes, change_of_paper, lambda value: f"{value:+.0f}"
    )
    name, find = reference_of(group, study, reference)
    contrasts = [("less", difference, lambda value: ("" if value < 0 else "+") + number(value)), ("over", ratio, "{:.2f}".format)]
    for what, statistic, show in contrasts:

        def contrast(rows, column):
            other = find(rows)
            return None if other is None else cell(statistic, *paired(rows, other, column), show=show)

        table = lines(group, frames, errors, contrast)
        if table.empty:
            continue
        yield f"{title}: mean {what} that of {name}, same frames [95 % confidence]", table
        if by_object:
            yield f"{title}: mean {what} that of {name} by object, same frames [95 % confidence]", of_objects(group, errors, contrast)
    if by_object:
        yield f"{title}: means by object [95 % confidence]", of_objects(group, metrics, means)


def tables(rows, reference=None, by_object=False):
    """Titles and tables of all studies, datasets and levels."""
    for _, group in rows[rows["study"] != "half_turns"].groupby(GROUP, sort=False):
        found = level_tables(group, reference, by_object)
        yield from ((title, table) for title, table in found if len(table))


def markdown(table):
    """A table in Markdown: the first column to the left, the others to the right."""
    cells = [[str(name).replace("|", "\\|") for name in table.columns], *table.fillna("-").astype(str).to_numpy()]
    body = ["| " + " | ".join(row) + " |" for row in cells]
    return "\n".join([body[0], "|---|" + "--:|" * (len(table.columns) - 1), *body[1:]])
