"""Calibration of the posteriors that a method states: coverage, reliability, and ranking of failures."""

import numpy as np
import pandas as pd
from rows import GROUP
from scipy import stats
from summaries import cell, mean

ELLIPSOIDS = {"pose": ("d2_pose", 6), "position": ("d2_position", 3), "orientation": ("d2_orientation", 3)}
"""Squared Mahalanobis distances of the truth, and their degrees of freedom."""
NOMINAL = (0.5, 0.9, 0.95)
EVENTS = {
    "1 mm": ("p_1mm", 1.0, np.inf),
    "2 mm": ("p_2mm", 2.0, np.inf),
    "5 mm": ("p_5mm", 5.0, np.inf),
    "1°": ("p_1deg", np.inf, 1.0),
    "2°": ("p_2deg", np.inf, 2.0),
    "5°": ("p_5deg", np.inf, 5.0),
    "5 mm and 5°": ("p_5mm_5deg", 5.0, 5.0),
}
"""Events: the column of their predicted probability, and the largest errors of position [mm] and orientation [°]."""
BINS = 10
DRAWS = 200


def contents(rows, ellipsoid):
    """Probability content of the smallest ellipsoids that hold the truth: uniform if calibrated, 1 for a singular covariance."""
    column, freedom = ELLIPSOIDS[ellipsoid]
    return stats.chi2.cdf(rows[column].fillna(np.inf), freedom)


def predictions(rows, event):
    """Predicted probabilities of an event, and whether it occurred."""
    column, position, orientation = EVENTS[event]
    occurred = (rows["distance_mm"] <= position) & (rows["angle_deg"] <= orientation)
    return rows[column].to_numpy(), occurred.to_numpy(float)


def bins(probability, occurred, count=BINS):
    """Sizes, mean predictions and frequencies of bins of equal counts, by growing probability."""
    order = np.argsort(probability, kind="stable")
    n, count = len(order), min(count, len(order))
    parts = np.split(order, [k * n // count for k in range(1, count)])
    return np.array([[len(part), probability[part].mean(), occurred[part].mean()] for part in parts]).T


def calibration_error(probability, occurred, count=BINS):
    """Expected calibration error (Naeini, Cooper and Hauskrecht, AAAI 2015) over bins of equal counts."""
    sizes, predicted, frequency = bins(probability, occurred, count)
    return np.average(np.abs(predicted - frequency), weights=sizes)


def error_by_chance(probability):
    """Mean calibration error of outcomes drawn from the predicted probabilities."""
    draws = np.random.default_rng(3).random((DRAWS, len(probability))) < probability
    return np.mean([calibration_error(probability, draw.astype(float)) for draw in draws])


def brier(probability, occurred):
    """Brier's score (1950): the mean squared distance of probability and outcome."""
    return np.mean((probability - occurred) ** 2)


def area_under_roc(scores, positive):
    """Area under the receiver operating characteristic, ties counting half (Mann and Whitney, 1947); NaN unless there are both."""
    positive = np.asarray(positive, bool)
    ones, others = scores[positive], scores[~positive]
    if not len(ones) or not len(others):
        return np.nan
    return stats.mannwhitneyu(ones, others).statistic / (len(ones) * len(others))


def area_interval(area, positives, negatives):
    """95 % interval of an area (Hanley and McNeil, Radiology 1982)."""
    square = area * area
    q1, q2 = area / (2.0 - area), 2.0 * square / (1.0 + area)
    variance = area * (1.0 - area) + (positives - 1.0) * (q1 - square) + (negatives - 1.0) * (q2 - square)
    half = stats.norm.ppf(0.975) * np.sqrt(max(variance, 0.0) / (positives * negatives))
    return max(area - half, 0.0), min(area + half, 1.0)


def coverage_table(rows):
    return pd.DataFrame(
        {
            "ellipsoid of": ellipsoid,
            "should hold %": f"{100 * nominal:.0f}",
            "holds %": cell(mean, 100.0 * (contents(rows, ellipsoid) <= nominal), show="{:.1f}".format),
        }
        for ellipsoid in ELLIPSOIDS
        for nominal in NOMINAL
    )


def error_table(rows):
    root = lambda column: np.sqrt(np.mean(rows[column] ** 2))  # noqa: E731
    return pd.DataFrame(
        {
            "error of": name,
            "root mean square": f"{root(error):.2f}",
            "stated": f"{root(sigma):.2f}",
            "Cramér–Rao bound": f"{root(bound):.2f}",
            "median": f"{rows[error].median():.2f}",
        }
        for name, error, sigma, bound in [
            ("position mm", "distance_mm", "sigma_mm", "bound_mm"),
            ("orientation °", "angle_deg", "sigma_deg", "bound_deg"),
        ]
    )


def event_table(rows):
    def line(event):
        probability, occurred = predictions(rows, event)
        return {
            "within": event,
            "predicted %": f"{100 * probability.mean():.1f}",
            "true %": f"{100 * occurred.mean():.1f}",
            "calibration error": f"{calibration_error(probability, occurred):.3f}",
            "by chance": f"{error_by_chance(probability):.3f}",
            "Brier": f"{brier(probability, occurred):.3f}",
        }

    return pd.DataFrame(line(event) for event in EVENTS)


def failure_table(rows):
    probability, occurred = predictions(rows, "5 mm and 5°")
    failed = occurred == 0.0
    area, failures = area_under_roc(-probability, failed), int(failed.sum())
    text = "-"
    if not np.isnan(area):
        low, high = area_interval(area, failures, len(rows) - failures)
        text = f"{area:.3f} [{low:.3f}, {high:.3f}]"
    poses = f"{failures} of {len(rows)}"
    return pd.DataFrame([{"poses": "not within 5 mm and 5°", "number": poses, "area under the ROC curve": text}])


def stated(rows):
    """Rows with a posterior, by study, dataset, level (and over all) and method; not those under a fault that the study made."""
    known = rows[rows["distance_mm"].notna() & rows["sweep"].isna()]
    for (study, dataset, method), found in known.groupby(["study", "dataset", "method"], sort=False):
        levels = [(f"noise {level}", part) for level, part in found.groupby("level", sort=False)]
        for level, part in levels + ([("all noise", found)] if len(levels) > 1 else []):
            yield f"{study} {dataset}, {level}, {method}", part


def calibrations(rows):
    """Titles and tables of all posteriors."""
    for title, part in stated(rows):
        yield f"{title}: % of {len(part)} true poses within ellipsoids of the posterior [95 % confidence]", coverage_table(part)
        yield f"{title}: errors, what the posterior states, and what the information in the frames allows", error_table(part)
        yield f"{title}: predicted probabilities", event_table(part)
        yield f"{title}: failures", failure_table(part)


ACCURACY = ["set", "n", "PE cm", "median", "OE °", "median", "right", "mean p", "Brier", "share's", "right and sure", "sure, wrong"]
AVERAGES = [
    ("pe_cm", lambda errors: f"{errors.mean():.3f}"),
    ("pe_cm", lambda errors: f"{errors.median():.3f}"),
    ("oe_deg", lambda errors: f"{errors.mean():.2f}"),
    ("oe_deg", lambda errors: f"{errors.median():.2f}"),
]


def accuracy(rows):
    """A row a dataset and level of the methods that state a probability, and the area under the ROC curve over all that began as given.

    A pose is right within 5 mm and 5°, and sure above 0.9.
    """
    known = rows[rows["probability"].notna()]
    table = []
    for (dataset, level, method), part in known.groupby(["dataset", "level", "label"], sort=False):
        right, p, sure = part["right"], part["probability"], part["probability"] > 0.9
        share = right.mean()
        name = {"given": dataset, "turned": f"{dataset}, turned"}.get(level, f"{dataset}, {level}, {method}")
        table.append(
            [
                name,
                len(part),
                *(show(part[column]) for column, show in AVERAGES),
                f"{100 * share:.1f} %",
                f"{p.mean():.3f}",
                f"{brier(p, right):.3f}",
                f"{share * (1 - share):.3f}",
                f"{100 * sure[right].mean():.0f} %",
                f"{(sure & ~right).sum()} of {sure.sum()}",
            ]
        )
    given = known[known["level"] != "turned"]
    return pd.DataFrame(table, columns=ACCURACY), area_under_roc(given["probability"].to_numpy(), given["right"])
