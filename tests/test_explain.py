"""`bench paper --explain`: a planted cause is the one that is named."""

import csv
import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import bench
from graphs import random_edges, simulated
from scenes import write_scene

from bench.core import so3
from bench.core.errors import InputError
from bench.core.problem import Checkpoint, Estimate, Floats, Instance
from bench.papers.explain.cells import candidates, cells
from bench.papers.explain.measure import CHOICES, Answer, Measure
from bench.papers.explain.switches import Explained, Setting, explain, switches, together
from bench.papers.kinds.scenes.table import SceneTable
from bench.papers.layout import load_layout
from bench.papers.published import read_published

METHODS = ("ours", "theirs")
PROTOCOLS = ("truth-subgraph", "component")
BASE = Setting("ours", "truth-subgraph", Measure())


def folded(seed: int, noise_deg: float = 2.0) -> Answer:
    """An estimate with a quarter of the cameras turned by 25 degrees, a few not solved, and a better checkpoint."""
    problem, truth = simulated(random_edges(40, 0.3), noise_deg=2, seed=seed)
    rng = np.random.default_rng(seed)

    def noisy(degrees: float) -> Floats:
        return so3.exp(np.radians(degrees) * rng.standard_normal((40, 3))) @ truth

    estimate = noisy(noise_deg)
    estimate[:10] = estimate[:10] @ so3.exp(np.radians([25, 0, 0]))
    checkpoint = Checkpoint(1, 0.1, noisy(0.3))
    last = estimate.copy()
    last[-3:] = np.nan
    return Estimate(last, checkpoints=(checkpoint, Checkpoint(2, 0.2, last))), Instance(
        problem, truth, "toy", revision="1"
    )


ANSWERS = {
    ("ours", "truth-subgraph"): [folded(0), folded(1, 2.5), folded(6, 2.1)],
    ("theirs", "truth-subgraph"): [folded(2, 4.0), folded(3, 4.0)],
    ("ours", "component"): [folded(4, 1.0), folded(5, 1.0)],
}


def stored(method: str, protocol: str) -> tuple[Sequence[Answer], str]:
    return ANSWERS[method, protocol], "ok"


def explained(published: str) -> Explained:
    return explain("Toy", "Ours", published, BASE, list(switches(BASE, METHODS, PROTOCOLS)), stored)


PLANTED = [
    *(
        (name, choice)
        for name, choices in CHOICES.items()
        for choice in choices
        if choice != getattr(BASE.measure, name)
    ),
    ("method", "theirs"),
    ("protocol", "component"),
]


@pytest.mark.parametrize(("name", "choice"), [entry for entry in PLANTED if entry[0] != "angle"])
def test_a_planted_cause_is_named(name: str, choice: str) -> None:
    setting = replace(BASE, **{name: choice}) if name in ("method", "protocol") else None
    setting = setting or replace(BASE, measure=replace(BASE.measure, **{name: choice}))
    number = setting.measure.of(ANSWERS[setting.method, setting.protocol])
    result = explained(f"{number:.9f}")
    best = result.closest
    assert best is not None
    assert (best.switch, best.after) == (name, choice)
    assert best.gap_after < 1e-8 < best.gap_before
    assert f"{name} {best.before} -> {choice}" in result.sentence()
    assert "100% of the gap closed" in result.sentence()


def test_arccos_moves_what_is_far_below_a_microdegree_and_nothing_else() -> None:
    answer = ANSWERS["ours", "truth-subgraph"]
    plain, clamped = Measure(), Measure(angle="arccos")
    assert clamped.of(answer) == pytest.approx(plain.of(answer), abs=1e-9)
    estimate, instance = answer[0]
    assert instance.truth is not None
    tiny = replace(estimate, rotations=instance.truth @ so3.exp(np.array([1e-9, 0, 0])))
    for over in ("cameras", "edges", "pairs"):
        assert Measure(over=over, angle="arccos").of([(tiny, instance)]) < 3e-6


def test_over_edges_and_pairs_no_gauge_matters() -> None:
    estimate, instance = ANSWERS["ours", "truth-subgraph"][0]
    turned = replace(estimate, rotations=estimate.rotations @ so3.exp(np.array([0.3, 2.0, -1.0])))
    for over in ("edges", "pairs"):
        numbers = [Measure(rule, over=over).of([(turned, instance)]) for rule in ("l1", "karcher")]
        assert numbers == pytest.approx([Measure(over=over).of([(estimate, instance)])] * 2, abs=1e-9)


def test_what_is_not_solved_counts_as_wrong_where_asked() -> None:
    estimate, instance = ANSWERS["ours", "truth-subgraph"][0]
    known = Measure(statistic="mean")
    left_out, counted = (replace(known, unsolved=u).of([(estimate, instance)]) for u in CHOICES["unsolved"])
    assert counted == pytest.approx((37 * left_out + 3 * 180) / 40)


def test_no_switch_is_named_where_none_helps() -> None:
    numbers = [row.measured for row in explained("1.0").rows]
    published = f"{BASE.measure.of(ANSWERS['ours', 'truth-subgraph']):.9f}"
    assert "None of" in explained(published).sentence()
    assert "They agree in the digits that are printed." in explained(published).sentence()
    far = explained(f"{max(numbers) + 50:.1f}").sentence()
    assert "which is not there yet" in far


def test_what_did_not_end_well_is_a_row_with_its_status_and_never_the_closest() -> None:
    def answers(method: str, protocol: str) -> tuple[Sequence[Answer], str]:
        return ([], "timeout") if method == "theirs" else (ANSWERS[method, protocol], "ok")

    result = explain("Toy", "Ours", "9.0", BASE, list(switches(BASE, METHODS, PROTOCOLS)), answers)
    rows = dict(result.grid().rows)
    failed = rows["method", "ours", "theirs"]
    assert [cell.text for cell in failed][::2] == ["TO", "–"]
    bold = [facts for facts, cells in rows.items() if cells[0].bold]
    assert len(bold) == 1
    assert f"{bold[0][0]} {bold[0][1]} -> {bold[0][2]}" in result.sentence()


def test_nothing_measured_is_said() -> None:
    result = explain("Toy", "Ours", "1.0", BASE, list(switches(BASE, METHODS, PROTOCOLS)), lambda *_: ([], "timeout"))
    assert "nothing was measured" in result.sentence()


def test_over_several_cells_the_switch_that_explains_all_beats_one_that_explains_one() -> None:
    def answers(scene: int) -> list[Answer]:
        return [folded(10 * scene + k, 1.0 + scene) for k in range(3)]

    def cell(scene: int) -> Explained:
        published = f"{replace(BASE.measure, alignment='karcher').of(answers(scene)):.9f}"
        tried = list(switches(BASE, (), ()))
        return explain(f"Scene {scene}", "Ours", published, BASE, tried, lambda *_: (answers(scene), "ok"))

    (sentence,) = together([cell(1), cell(2), cell(3)])
    assert "Ours, 3 scenes together" in sentence
    assert sentence.endswith("alignment l1 -> karcher, 0.000.")
    assert not list(together([cell(1)]))


def table() -> tuple[SceneTable, list[dict[str, str]]]:
    layout = load_layout("dmf-synch-2023")
    item = layout.item("table1")
    assert isinstance(item, SceneTable)
    return item, read_published(layout.sources.published, item.published)


@pytest.mark.parametrize("name", ["Ellis Island/L1-IRLS", "Ellis_Island/l1-irls", "ellis/l1irls", "Ellis / L1"])
def test_a_cell_has_a_pleasant_name(name: str) -> None:
    assert cells(name, *table()) == [("Ellis Island", "L1-IRLS")]


def test_a_scene_alone_stands_for_every_measured_column() -> None:
    item, rows = table()
    assert cells("Ellis", item, rows) == [("Ellis Island", column) for column in item.measured]
    assert cells("Ellis/L1-IRLS/DMF-Synch", *table()) == [("Ellis Island", "L1-IRLS"), ("Ellis Island", "DMF-Synch")]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Elis Island/L1-IRLS", "did you mean 'Ellis Island'"),
        ("Ellis/L1-IRSL", "did you mean 'L1-IRLS'"),
        ("M/L1-IRLS", "may be Madrid Metropolis or Montreal Notre Dame"),
        ("", "no scene ''"),
    ],
)
def test_a_wrong_name_is_one_sentence(name: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        cells(name, *table())


def test_a_column_that_is_published_only_has_no_cell_to_explain() -> None:
    item, rows = table()
    alone = replace(item, measured={**item.measured, "NeuRoRA": ()})
    with pytest.raises(InputError, match="published only; measured are DMF-Synch, MSP, PoGO-Net, L1-IRLS"):
        cells("Ellis/NeuRoRA", alone, rows)


def test_the_first_candidate_is_what_the_table_measures() -> None:
    item, _ = table()
    assert candidates(item, "L1-IRLS")[0] == item.measured["L1-IRLS"][0]
    assert set(candidates(item, "DMF-Synch")) > set(item.measured["DMF-Synch"])


def test_the_command_runs_what_is_missing_and_names_a_switch(tmp_path: Path) -> None:
    write_scene(tmp_path / "data" / "Ellis_Island")
    arguments = ("paper", "dmf-synch-2023", "table1", "--explain", "Ellis/L1-IRLS", "--data-dir", tmp_path / "data")
    first = bench(*arguments, "--out", tmp_path / "run", "--format", "csv")
    rows = list(csv.DictReader(io.StringIO(first.stdout)))
    assert {row["switch"] for row in rows} >= {"alignment", "protocol", "statistic", "over", "angle", "method"}
    assert all(row["status"] == "ok" for row in rows)
    again = bench(*arguments, "--out", tmp_path / "run")
    assert "1 job, 1 of them done already" in again.stderr
    assert "single switches" in " ".join(again.stdout.split())


def test_what_cannot_be_explained_is_refused(tmp_path: Path) -> None:
    out = ("--out", tmp_path / "run")
    figure = bench("paper", "dmf-synch-2023", "fig3", "--explain", "Ellis/L1-IRLS", *out, code=2)
    assert "takes a table of scenes" in figure.stderr
    missing = bench(
        "paper", "dmf-synch-2023", "table1", "--explain", "Alamo/L1-IRLS", "--data-dir", tmp_path, *out, code=2
    )
    assert "data fetch 1dsfm" in missing.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.real_data
def test_on_ellis_island_the_loss_of_chatterjee_and_govindu_explains_l1_irls(real_data: Path, tmp_path: Path) -> None:
    done = bench(
        *("paper", "dmf-synch-2023", "table1", "--explain", "Ellis/L1-IRLS", "--data-dir", real_data),
        *("--out", tmp_path / "run"),
    )
    text = " ".join(done.stdout.split())
    assert "method l1-irls -> l1-irls[loss=l-half] gives 0.5" in text
    assert "which prints as published" in text
