"""Tables of `prehend study`, read and checked."""

from pathlib import Path

import numpy as np
import pandas as pd

PUBLISHED = Path(__file__).parents[2] / "crates/refine/src/evaluate/study/published.csv"

ROW = ["study", "dataset", "level", "frame", "method", "steps", "sweep", "amount"]
"""Columns that together name a row."""
RUN = ["program", "inputs", "settings", "seed"]
"""Columns in which all rows of a method on a dataset and level agree."""
STATED = ["distance_mm", "angle_deg", "d2_pose", "probability"]
"""Columns of what a method states of its error, and of that error."""
GROUP = ["study", "dataset", "level"]
"""Columns that name the frames of a table."""


def read(arguments):
    """The rows of all `[NAME=]CSV[,CSV…]`, shards of one study among them; NAME replaces that of the dataset.

    Adds `label`, the name of a row in tables, and `right`, within 5 mm and 5°. Raises ValueError where files are of different runs.
    """
    parts = []
    for argument in arguments:
        name, _, files = argument.rpartition("=")
        for file in files.split(","):
            part = pd.read_csv(file, dtype=dict.fromkeys(RUN[:3], str))
            if "turn" in part:
                turned = np.where(part["turn"] == "none", "given", "turned")
                part = part.assign(study="half_turns", dataset=file, level=turned, method="fused", status="ok")
                part["frame"] = np.arange(len(part))
            parts.append(part.assign(dataset=name) if name else part)
    rows = pd.concat(parts, ignore_index=True)
    rows = rows.reindex(columns=rows.columns.union([*ROW, *RUN, *STATED, "frames"], sort=False))
    if "half_turns" not in set(rows["study"]):
        rows = rows.drop_duplicates(ROW, keep="last")
        runs = rows.groupby([*GROUP, "method"])[RUN].nunique()
        if (runs > 1).any(axis=None):
            raise ValueError(f"rows of different runs are mixed:\n{runs[(runs > 1).any(axis=1)]}")
    # Intervals are then the same for any order of the files.
    rows = rows.sort_values("frame", kind="stable", ignore_index=True)
    # The errors that the posterior is of are those of the object's center.
    position = rows["distance_mm"].fillna(10.0 * rows["pe_cm"])
    orientation = rows["angle_deg"].fillna(rows["oe_deg"])
    right = (position <= 5.0) & (orientation <= 5.0)
    return rows.assign(label=rows.apply(label, axis=1), right=right)


def label(row):
    """The name of a row in tables: its method, its number of steps, or its method under a fault."""
    if not pd.isna(row["steps"]):
        return f"{int(row['steps'])} steps"
    if not pd.isna(row["sweep"]):
        return f"{row['method']} {row['sweep']} {int(row['amount'])}"
    return row["method"]


def problems(rows):
    """A line for each failure and for each row of a table that lacks frames."""
    failed = rows[rows["status"] != "ok"]
    for row in failed.itertuples():
        yield f"{row.dataset}, {row.level}: scene {row.scene_id} image {row.im_id} object {row.obj_id}: {row.label}: {row.status}"
    for (study, dataset, level, name), found in rows.groupby([*GROUP, "label"], sort=False):
        lacking = found["frames"].max() - len(found)
        if lacking > 0:
            yield f"{study} {dataset}, {level}: {name}: {int(lacking)} of {int(found['frames'].max())} frames are in none of the files"


def published(study, level, name):
    """The published means of a row of a table, by the names of metrics; empty if there are none."""
    rows = pd.read_csv(PUBLISHED)
    of_study = rows["studies"].str.split().map(lambda studies: study in studies)
    found = rows[of_study & (rows["level"] == level) & (rows["row"] == name)]
    return found.iloc[0, 3:].dropna().astype(float) if len(found) else pd.Series(dtype=float)
