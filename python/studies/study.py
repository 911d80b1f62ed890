"""Statistics and plots of studies, from the tables that `prehend study` and the example `half_turns` write.

    python3 python/studies/study.py [NAME=]CSV[,CSV...] ... [--reference METHOD] [--by-object] [--plots DIR]

Prints, in Markdown: means, medians, changes and paired contrasts with intervals of resampled frames; calibrations of what
methods state of their errors; and a summary of accuracy and probability. Needs pandas, scipy and, for plots, matplotlib.
"""

import argparse
import sys
from pathlib import Path

from calibration import accuracy, calibrations
from rows import problems, read
from summaries import markdown, tables


def main(words=None):
    """Runs the script with the words of a command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", metavar="[NAME=]CSV[,CSV...]", help="tables; NAME replaces that of the dataset")
    parser.add_argument("--reference", metavar="METHOD", help="compare with this method, instead of the study's own")
    parser.add_argument("--by-object", action="store_true", help="tables of every object, too")
    parser.add_argument("--plots", metavar="DIR", type=Path, help="write plots there, as SVG")
    given = parser.parse_args(words)
    try:
        rows = read(given.files)
    except (OSError, ValueError) as error:
        sys.exit(f"error: {error}")
    for title, table in [*tables(rows, given.reference, given.by_object), *calibrations(rows)]:
        print(f"**{title}**\n\n{markdown(table)}\n")
    summary, area = accuracy(rows)
    if len(summary):
        print(f"**accuracy and probability**\n\n{markdown(summary)}\n\nArea under the ROC curve: {area:.3f}\n")
    if told := list(problems(rows)):
        print("**failed or missing**\n\n" + "\n".join(f"- {line}" for line in told))
    if given.plots:
        from plots import plots

        given.plots.mkdir(parents=True, exist_ok=True)
        for name, figure in plots(rows):
            figure.savefig(given.plots / f"{name}.svg")


if __name__ == "__main__":
    main()
