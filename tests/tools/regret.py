"""How much worse than the best method `recommend` does on real graphs with truth; see results/reference/recommend.

    python tests/tools/regret.py --data-dir DIR --work DIR

The candidates solve every real graph, and each graph is asked about as a user would, its truth unused. Where evidence
decides, it is that of other collections. Writes errors.csv, which `recommend` reads, and regret.csv.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from bench.advice.choice import choose
from bench.advice.evidence import FILE, FOLDER, of_other_graphs
from bench.advice.look import look
from bench.advice.recommendation import doubted
from bench.advice.trial import SUITE, load, tried
from bench.core.errors import InputError
from bench.plugins.selection import format_selection
from bench.running.run import Options, Run
from bench.scoring.results import score
from bench.suite.experiment import Suite, load_suite

RESULTS = Path(__file__).parents[2] / "results" / "reference" / FOLDER
BASELINES = ("consensus", "l1-irls")
ONE_DSFM = ("Ellis_Island", "Madrid_Metropolis", "NYC_Library", "Piazza_del_Popolo")
IMAGES = ("castle-P30", "fountain-P11", "lego")
FRAGMENTS = (
    "7-scenes-redkitchen",
    "sun3d-home_at-home_at_scan1_2013_jan_1",
    "sun3d-home_md-home_md_scan9_2012_sep_30",
    "sun3d-hotel_uc-scan3",
    "sun3d-hotel_umd-maryland_hotel1",
    "sun3d-mit_76_studyroom-76-1studyroom2",
)
RENDERED = ("iclnuim-livingroom1", "iclnuim-livingroom2", "iclnuim-office1")
DESCRIPTORS = ("3dmatch", "fpfh", "spin", "pcl_modified")
SCANNET = tuple(
    f"scene{scene}"
    for scene in (
        *("0006_00", "0025_01", "0200_00", "0242_02", "0260_01"),
        *("0302_00", "0321_00", "0354_00", "0367_01", "0418_00"),
    )
)
REDWOOD = ("00033", "00288", "01030", "01191", "01201", "01668", "05150", "05452", "05702", "05970")


def graphs() -> Iterator[tuple[str, str]]:
    """Collection and selection of every graph."""
    for scene in ONE_DSFM:
        yield "1DSfM", format_selection("1dsfm", {"scene": scene})
    for scene in IMAGES:
        yield "image-graph", format_selection("image-graph", {"scene": scene})
    yield "anisotropic", "anisotropic"
    for scene in FRAGMENTS:
        yield "3DMatch", format_selection("registration", {"scene": scene})
    for descriptor in DESCRIPTORS:
        for scene in RENDERED:
            yield "ICL-NUIM", format_selection("registration", {"scene": scene, "descriptor": descriptor})
    for collection, title, scenes in (("scannet", "ScanNet", SCANNET), ("redwood", "Redwood", REDWOOD)):
        for scene in scenes:
            yield title, format_selection("scan-graph", {"collection": collection, "scene": scene})


def real_errors(data_dir: Path, work: Path, jobs: int) -> pd.DataFrame:
    """What the candidates do on the real graphs, a row a job; what is done is not run again."""
    candidates = load_suite(SUITE)
    selections = tuple(selection for _, selection in graphs())
    suite = Suite("real", "Real graphs", selections, candidates.methods, 1, 60.0, candidates.memory_gib)
    run = Run(suite, (), (), Options(out=work / "real", data_dir=data_dir, jobs=jobs))
    run.prepare(print)
    for cell, record in run.execute():
        print(cell.job.instance, cell.job.label, record.outcome.text, flush=True)
    frame = score(run.store, jobs=[cell.job for cell in run.cells]).frame
    return frame.assign(selection=[cell.job.dataset for cell in run.cells])


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data-dir", type=Path, required=True)
    parser.add_argument("--work", type=Path, required=True, help="for the runs; a stopped measurement continues there")
    parser.add_argument("--budget", type=float, default=60.0)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    real = real_errors(given.data_dir, given.work, given.jobs)
    asked, kept = [], []
    for count, (collection, selection) in enumerate(graphs()):
        own = real[real["selection"] == selection]
        if own.empty:
            raise InputError(f"{selection} is not among the real graphs that were run")
        options = Options(out=given.work / f"twin-{count}", data_dir=given.data_dir, jobs=given.jobs)
        seen = look(load(selection, given.data_dir).problem)
        trial = tried(selection, options, budget_s=given.budget)
        doubts = doubted(seen, trial)
        [ties] = trial.results.ties.values()
        choice = choose(trial.results.frame, ties)
        print(
            count, own["instance"].iloc[0], seen.kind, f"{trial.misfit(seen):.2f}", trial.twins, choice.recommended.name
        )
        asked.append((collection, seen, trial, doubts, choice, own))
        kept.append(own.assign(collection=collection, kind=seen.kind, trusted=not doubts))
    evidence = pd.concat(kept)[COLUMNS]
    RESULTS.mkdir(parents=True, exist_ok=True)
    evidence.to_csv(RESULTS / FILE, index=False, float_format="%.6g")
    table = pd.DataFrame([row(evidence, *one) for one in asked])
    table.to_csv(RESULTS / "regret.csv", index=False, float_format="%.4g")
    print(table.to_string())


COLUMNS = [
    *("collection", "dataset", "instance", "protocol", "instance_key", "kind", "trusted", "method", "params", "seed"),
    *("n_cameras", "n_edges", "n_scored", "outcome", "mean_deg", "median_deg", "solve_s"),
]


def row(
    evidence: pd.DataFrame, collection: str, seen: Any, trial: Any, doubts: list[str], by_twins: Any, own: pd.DataFrame
) -> dict[str, Any]:
    """A graph: what was recommended, and how much worse that and the baselines are than the best candidate."""
    others = evidence[evidence["collection"] != collection]
    choice = of_other_graphs(others, seen.kind, trial.able).choice if doubts else by_twins
    chosen = choice.recommended.name
    by_method = own.set_index("method")
    found = {
        "collection": collection,
        "instance": own["instance"].iloc[0],
        "kind": seen.kind,
        "misfit": trial.misfit(seen),
        "decided_by": "evidence" if doubts else "twins",
        "twins": trial.twins,
        "recommended": chosen,
        "by_twins": by_twins.recommended.name,
        "expected_median_deg": by_twins.recommended.median.middle,
    }
    for statistic in ("median", "mean"):
        errors = by_method[f"{statistic}_deg"]
        found |= {f"best_{statistic}": errors.idxmin(), f"best_{statistic}_deg": errors.min()}
        for name, method in [("", chosen), ("_by_twins", found["by_twins"]), *((f"_{b}", b) for b in BASELINES)]:
            found[f"regret_{statistic}{name}"] = errors[method] / errors.min() - 1
    return found


if __name__ == "__main__":
    main()
