"""Tables of accuracy and of probabilities, from what the example `half_turns` writes.

    python3 docs/scripts/confidence.py NAME=OUT.csv[,OUT.csv...] ...

For each NAME: poses whose initial rotation was as given (turn `none`), then the others. A pose is right within 5 mm and 5°, and sure above 0.9.
The area under the ROC curve is over the poses of all names whose initial rotation was as given.
"""

import csv
import sys


def read(files):
    for file in files:
        with open(file, newline="") as table:
            for row in csv.DictReader(table):
                pe, oe = float(row["pe_cm"]), float(row["oe_deg"])
                right = pe <= 0.5 and oe <= 5.0
                yield row["turn"], pe, oe, right, float(row["probability"])


def mean(values):
    values = list(values)
    return sum(values) / len(values) if values else float("nan")


def median(values):
    values = sorted(values)
    return (values[(len(values) - 1) // 2] + values[len(values) // 2]) / 2


def row(name, poses):
    share = mean(right for *_, right, _ in poses)
    rights = [p for *_, right, p in poses if right]
    sure = [right for *_, right, p in poses if p > 0.9]
    cells = [
        name,
        len(poses),
        f"{mean(pe for _, pe, *_ in poses):.3f}",
        f"{median(pe for _, pe, *_ in poses):.3f}",
        f"{mean(oe for _, _, oe, *_ in poses):.2f}",
        f"{median(oe for _, _, oe, *_ in poses):.2f}",
        f"{100 * share:.1f} %",
        f"{mean(p for *_, p in poses):.3f}",
        f"{mean((p - right) ** 2 for *_, right, p in poses):.3f}",
        f"{share * (1 - share):.3f}",
        f"{100 * mean(p > 0.9 for p in rights):.0f} %",
        f"{len(sure) - sum(sure)} of {len(sure)}",
    ]
    print("| " + " | ".join(map(str, cells)) + " |")


def main():
    print("| set | n | PE cm | median | OE ° | median | right | mean p | Brier | share's | right and sure | sure, wrong |")
    print("|---|" + "--:|" * 11)
    everything = []
    for argument in sys.argv[1:]:
        name, _, files = argument.partition("=")
        poses = list(read(files.split(",")))
        given = [pose for pose in poses if pose[0] == "none"]
        others = [pose for pose in poses if pose[0] != "none"]
        everything += given
        row(name, given)
        if others:
            row(f"{name}, turned", others)
    wrong = [p for *_, right, p in everything if not right]
    right = [p for *_, right, p in everything if right]
    if wrong and right:
        area = mean(float(a > b) + 0.5 * (a == b) for a in right for b in wrong)
        print(f"\nArea under the ROC curve: {area:.3f}")


if __name__ == "__main__":
    main()
