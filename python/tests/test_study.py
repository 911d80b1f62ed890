"""Statistics of studies in `python/studies`: figures known by hand, from tables made here and by the command (PREHEND_COMMAND)."""

import contextlib
import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

np = pytest.importorskip("numpy")
pd = pytest.importorskip("pandas")
stats = pytest.importorskip("scipy.stats")

STUDIES = Path(__file__).parents[1] / "studies"
COMMAND = os.environ.get("PREHEND_COMMAND")
METHODS = {"truth": 0.0, "initial": 1.0, "combined": 0.25, "robust-icp": 2.0}
RUN = {"program": "0.1.0 ab", "inputs": "1e5", "settings": "12", "seed": 0}


@pytest.fixture(scope="module", autouse=True)
def modules():
    sys.path.insert(0, str(STUDIES))
    yield
    sys.path.remove(str(STUDIES))


def script(*words):
    """What the script prints."""
    import study

    with contextlib.redirect_stdout(io.StringIO()) as text:
        study.main([str(word) for word in words])
    return text.getvalue()


def printed(text, title):
    """The rows of a printed table, by their first cell."""
    body = text.split(f"**{title}")[1].split("**\n\n")[1].split("\n\n")[0]
    rows = [[cell.strip() for cell in line.strip("|").split(" |")] for line in body.splitlines()]
    return {row[0]: row[1:] for row in [rows[0], *rows[2:]]}


def example(study="main", dataset="ds"):
    """Two levels of three frames: errors of the initial poses are 1, 2, 3 and 2, 4, 6; one method fails on the last frame of the first level."""
    rows = []
    for level, scale in [("low", 1.0), ("high", 2.0)]:
        for frame in range(3):
            for method, factor in METHODS.items():
                where = {"study": study, "dataset": dataset, "level": level, "frame": frame, "method": method, "frames": 3}
                where |= {"scene_id": 1, "im_id": frame, "obj_id": 5 + frame // 2, "status": "ok", "sweep": None, "steps": None}
                error = factor * scale * (1 + frame)
                scores = {"pe_cm": error, "oe_deg": 5.0, "ca_cm2": 30.0 + factor, "delta_ca_cm2": factor, "delta_iv_cm3": error}
                if (level, frame, method) == ("low", 2, "robust-icp"):
                    where["status"], scores = "no pixel", {}
                rows.append(where | scores | RUN)
    return pd.DataFrame(rows)


def calibrated(count, seed=0):
    """A table of a method that is exactly as sure as it should be, 1 mm and 1° a standard deviation along each axis."""
    random = np.random.default_rng(seed)
    error = random.normal(size=(count, 6))
    squared = error**2
    position, turn = (squared[:, k : k + 3].sum(axis=1) for k in (0, 3))
    rows = pd.DataFrame({"study": "confidence", "dataset": "made", "level": "low", "frame": range(count), "method": "fused", "status": "ok"})
    rows = rows.assign(frames=count, obj_id=5, steps=None, sweep=None, amount=None, **RUN, pe_cm=0.1 * position**0.5, oe_deg=turn**0.5)
    rows = rows.assign(distance_mm=position**0.5, angle_deg=turn**0.5, sigma_mm=3**0.5, sigma_deg=3**0.5, bound_mm=1.5, bound_deg=1.5)
    rows = rows.assign(d2_pose=squared.sum(axis=1), d2_position=position, d2_orientation=turn)
    within = {size: stats.chi2.cdf(size**2, 3) for size in (1, 2, 5)}
    for size, p in within.items():
        rows[f"p_{size}mm"] = rows[f"p_{size}deg"] = p
    return rows.assign(p_5mm_5deg=within[5] ** 2, probability=within[5] ** 2)


def test_means_medians_changes_and_contrasts_are_those_known_by_hand(tmp_path):
    table = example()
    # As two shards, one with rows of the other, too.
    table[::2].to_csv(tmp_path / "a.csv", index=False)
    table.to_csv(tmp_path / "b.csv", index=False)
    text = script(f"{tmp_path}/a.csv", f"{tmp_path}/b.csv")
    means = printed(text, "main ds, noise low: means over 3 frames")
    assert means["row"] == ["n", "PE cm", "OE °", "CA cm²", "\\|ΔCA\\| cm²", "\\|ΔIV\\| cm³"]
    assert means["initial"][:2] == ["3/3", "2.00 [1.00, 3.00]"]
    assert means["robust-icp"] == ["2/3", "3.00 [2.00, 4.00]", "5.00 [5.00, 5.00]", "32.00 [32.00, 32.00]", "2.00 [2.00, 2.00]", "3.00 [2.00, 4.00]"]
    # The last published row in the order of the table is the combined method's.
    assert means["· published"] == ["", "0.62", "6.69", "41.73", "5.45", "0.59"]
    medians = printed(text, "main ds, noise high: medians")
    assert (medians["initial"][1], medians["combined"][1]) == ("4.00", "1.00")
    changes = printed(text, "main ds, noise low: change of the mean")
    assert changes["combined"][:2] == ["3/3", "-75.0 [-75.0, -75.0]"]
    assert changes["robust-icp"][:2] == ["2/3", "+100.0 [+100.0, +100.0]"]
    assert changes["· published"][1:] == ["-5", "-4", "+97", "-73"]
    ratios = printed(text, "main ds, noise low: mean over that of robust-icp")
    # Of the frames that both have: 0.25 and 0.5 against 2 and 4.
    assert ratios["combined"][1:3] == ["0.12 [0.12, 0.12]", "1.00 [1.00, 1.00]"]
    less = printed(text, "main ds, noise low: mean less that of robust-icp")
    assert less["combined"][1] == "-2.62 [-3.50, -1.75]"
    assert "robust-icp" not in ratios
    assert "- ds, low: scene 1 image 2 object 6: robust-icp: no pixel" in text
    by_object = script("--by-object", "--reference", "combined", tmp_path / "b.csv")
    ratios = printed(by_object, "main ds, noise high: mean over that of combined by object")
    assert ratios["object 5: robust-icp"][:2] == ["2/2", "8.00 [8.00, 8.00]"] and ratios["object 6: robust-icp"][:2] == ["1/1", "8.00"]
    means = printed(by_object, "main ds, noise low: means by object")
    assert means["object 6: robust-icp"][:2] == ["0/1", "-"] and means["object 5: initial"][1] == "1.50 [1.00, 2.00]"


def test_different_runs_do_not_mix_and_missing_frames_are_told(tmp_path):
    table = example()
    table[table["frame"] != 1].to_csv(tmp_path / "a.csv", index=False)
    assert "- main ds, high: combined: 1 of 3 frames are in none of the files" in script(tmp_path / "a.csv")
    table.assign(seed=3)[table["frame"] == 1].to_csv(tmp_path / "b.csv", index=False)
    words = [sys.executable, STUDIES / "study.py", tmp_path / "a.csv", tmp_path / "b.csv"]
    ended = subprocess.run(words, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (1, "") and "different runs" in ended.stderr
    # Other datasets are other runs.
    text = script(f"one={tmp_path}/a.csv", f"two={tmp_path}/b.csv")
    assert printed(text, "main one, noise low: medians")["initial"][1] == "2.00"
    assert printed(text, "main two, noise low: medians")["initial"][1] == "2.00"


def test_faults_are_compared_with_the_reference_under_the_same_fault(tmp_path):
    rows = []
    for method, factor in [("robust-icp", 4.0), ("fused", 1.0)]:
        for amount in (0, 10):
            for frame in range(2):
                row = {"study": "robustness", "dataset": "ds", "level": "low", "frame": frame, "method": method, "frames": 2}
                row |= {"sweep": "hand-position", "amount": amount, "status": "ok", "obj_id": 5, "pe_cm": factor * (1 + amount), "oe_deg": None}
                rows.append(row | RUN)
    pd.DataFrame(rows).to_csv(tmp_path / "r.csv", index=False)
    ratios = printed(script(tmp_path / "r.csv"), "robustness ds, noise low: mean over that of robust-icp")
    assert ratios["fused hand-position 10"] == ["2/2", "0.25 [0.25, 0.25]"]
    assert len(ratios) == 3


def test_a_calibrated_method_is_found_to_be(tmp_path):
    calibrated(2000).to_csv(tmp_path / "c.csv", index=False)
    text = script(tmp_path / "c.csv")
    name = "confidence made, noise low, fused"
    body = text.split(f"**{name}: % of 2000 true poses")[1].split("**\n\n")[1].split("\n\n")[0]
    for line in body.splitlines()[2:]:
        _, nominal, holds = (cell.strip() for cell in line.strip("|").split("|"))
        low, high = map(float, holds.split("[")[1].strip("]").split(","))
        assert low - 1.0 <= float(nominal) <= high + 1.0, line
    errors = printed(text, f"{name}: errors")
    assert abs(float(errors["position mm"][0]) - 3**0.5) < 0.05 and errors["position mm"][1:3] == ["1.73", "1.50"]
    events = printed(text, f"{name}: predicted probabilities")
    assert events["1 mm"][0] == f"{100 * stats.chi2.cdf(1, 3):.1f}"
    assert abs(float(events["2°"][0]) - float(events["2°"][1])) < 4.0
    summary = printed(text, "accuracy and probability")
    assert summary["made, low, fused"][0] == "2000" and summary["made, low, fused"][5] == "100.0 %"


def test_scores_of_known_predictions():
    import calibration

    p, came = np.array([0.9, 0.1, 0.3, 0.7, 0.2]), np.array([1.0, 0.0, 1.0, 0.0, 0.0])
    sizes, predicted, frequency = calibration.bins(p, came, 2)
    assert sizes.tolist() == [2, 3] and frequency.tolist() == [0.0, pytest.approx(2 / 3)]
    assert predicted.tolist() == pytest.approx([0.15, 1.9 / 3])
    assert calibration.bins(p, came, 10).shape == (3, 5)
    assert calibration.calibration_error(p, came, 2) == pytest.approx((2 * 0.15 + 3 * (2 / 3 - 1.9 / 3)) / 5)
    assert calibration.brier(p, came) == pytest.approx((0.01 + 0.01 + 0.49 + 0.49 + 0.04) / 5)
    # Of a bin of 10 whose variance is about 1/6 a count, the mean distance is √(2/π/60) = 0.10; and it shrinks with numbers.
    few, many = (calibration.error_by_chance((np.arange(n) + 0.5) / n) for n in (100, 10_000))
    assert few == pytest.approx(0.10, abs=0.015) and many == pytest.approx(0.1 * few, rel=0.2)
    assert calibration.error_by_chance(np.array([1.0, 0.0])) == 0.0
    # Of six pairs, four are in order and one is tied.
    scores, positive = np.array([0.1, 0.4, 0.5, 0.5, 0.9]), [False, True, False, True, True]
    assert calibration.area_under_roc(scores, positive) == 4.5 / 6
    assert np.isnan(calibration.area_under_roc(scores, [True] * 5))
    # Hanley and McNeil: an area of 0.893 of 51 abnormal and 58 normal images has a standard error of about 0.032.
    low, high = calibration.area_interval(0.893, 51, 58)
    assert (high - low) / 2 / 1.96 == pytest.approx(0.032, abs=1e-3)


def test_intervals_are_those_of_the_textbook():
    from summaries import interval, mean, ratio

    # 40 of 100: the mean of a resample is Binomial(100, 0.4)/100, whose 2.5 % and 97.5 % quantiles are 0.31 and 0.50.
    assert interval(mean, (np.arange(100) < 40).astype(float)) == pytest.approx((0.31, 0.50), abs=0.011)
    sample = np.random.default_rng(5).normal(3.0, 2.0, 400)
    half = 1.96 * sample.std(ddof=1) / 20
    assert interval(mean, sample) == pytest.approx((sample.mean() - half, sample.mean() + half), abs=0.15 * half)
    assert interval(ratio, sample, 2.0 * sample) == pytest.approx((0.5, 0.5))
    assert np.isnan(interval(mean, sample[:1])).all()


def test_half_turns_are_summarized(tmp_path):
    rows = [("none", 0.1, 1.0, 0.95), ("none", 0.7, 1.0, 0.4), ("x", 0.1, 170.0, 0.92), ("y", 0.1, 2.0, 0.97)]
    pd.DataFrame(rows, columns=["turn", "pe_cm", "oe_deg", "probability"]).to_csv(tmp_path / "t.csv", index=False)
    text = script(f"real={tmp_path}/t.csv")
    summary = printed(text, "accuracy and probability")
    given = ["2", "0.400", "0.400", "1.00", "1.00", "50.0 %", "0.675", "0.081", "0.250", "100 %", "0 of 1"]
    assert summary["real"] == given
    assert summary["real, turned"][5] == "50.0 %" and summary["real, turned"][-1] == "1 of 2"
    assert "Area under the ROC curve: 1.000" in text


def test_plots_are_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    table = pd.concat([example(), calibrated(50).assign(angle_deg=lambda c: c["angle_deg"] * (1 + 9 * (c["frame"] % 2)))])
    table.to_csv(tmp_path / "s.csv", index=False)
    script(tmp_path / "s.csv", "--plots", tmp_path / "plots")
    names = {path.name for path in (tmp_path / "plots").glob("*.svg")}
    one = "confidence-made-noise-low-fused"
    assert {"main-ds-low-means.svg", "main-ds-high-cumulative.svg", f"{one}-reliability.svg", f"{one}-roc.svg"} <= names


def test_the_notebook_runs_to_its_end(tmp_path):
    for module in ("matplotlib", "nbclient", "ipykernel"):
        pytest.importorskip(module)
    import nbformat
    from nbclient import NotebookClient

    pd.concat([example(), calibrated(200)]).to_csv(tmp_path / "study.csv", index=False)
    notebook = nbformat.read(STUDIES / "study.ipynb", as_version=4)
    os.environ["PREHEND_STUDY"] = str(tmp_path / "study.csv")
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(STUDIES)}}).execute()


@pytest.mark.skipif(COMMAND is None, reason="PREHEND_COMMAND, the command prehend of the same build, is not set")
def test_a_table_of_the_command_is_summarized(tmp_path):
    def run(words):
        command = [str(Path(COMMAND).resolve()), *words.split()]
        return subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True).stdout

    run("synth --out ds --objects 004_sugar_box,061_foam_brick --frames 2 --frames-per-grasp 2")
    own = run("study confidence --dataset ds --out whole.csv")
    for shard in range(2):
        run(f"study confidence --dataset ds --out part{shard}.csv --shard {shard}/2")
    whole, parts = script(tmp_path / "whole.csv"), script(tmp_path / "part0.csv", tmp_path / "part1.csv")
    assert whole == parts and "failed or missing" not in whole
    assert "failed or missing" in script(tmp_path / "part0.csv")
    medians = printed(whole, "confidence ds, noise low: medians")
    theirs = own.split("confidence, noise low: medians")[1].split("\n\n")[1].splitlines()
    for line in theirs[2:]:
        row, *cells = line.split()
        assert medians[row] == cells
    table = pd.read_csv(tmp_path / "whole.csv")
    fused = table[table["method"] == "fused"]
    assert len(fused) == 8 and (fused["sigma_mm"] >= fused["bound_mm"]).all()
