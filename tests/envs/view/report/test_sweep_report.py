"""The report of a sweep is one file that works offline and says what was found, how surely, and what failed."""

import re
from pathlib import Path

import pytest

from haustra.envs.study.run import answer_all
from haustra.envs.study.sampling import designs_of, jobs_of
from haustra.envs.study.store import open_store
from haustra.envs.study.study import Result, ScoreError
from haustra.envs.view.report import sweep_report
from haustra.envs.view.report.sweep_report import report_sweep
from haustra.errors import InvalidOptionError, UnreadableFileError
from tests.envs.study.studies import study

CURVE = {"passage_pitches": [0.0, 0.5, 1.0], "force_per_track_N": [0.7, 0.8, 0.7]}


def _fill(folder: Path, *, jobs: int = 1000, **changes) -> Path:
    """A sweep whose numbers follow from the design's number; every fifth design fails."""
    asked = study(title="Pads <b>wet</b>", **changes)

    def answer(claim):
        for job in claim(jobs):
            if job.design % 5 == 4:
                yield Result(job.id, "failed", reason="too <i>thin</i>")
            else:
                friction = float(job.conditions["friction"])
                scores = {"force_N": 10 * friction + job.design, "ripple_fraction": 0.1 + 0.01 * (job.design % 3)}
                yield Result(job.id, "finished", scores, curves=CURVE)

    with open_store(folder, asked, lambda: jobs_of(asked, designs_of(asked)), kind="sweep", resume=False) as store:
        store.begin_session(backend="native", pool="here")
        answer_all(store, answer if jobs == 1000 else (lambda claim: answer(lambda most: claim(most)[:jobs])))
    return folder


@pytest.fixture(scope="module")
def page(tmp_path_factory) -> str:
    path, _ = report_sweep(_fill(tmp_path_factory.mktemp("sweep")))
    return path.read_text(encoding="utf-8")


def test_it_is_one_file_that_works_offline(page: str) -> None:
    body = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
    assert not re.findall(r'<(?:script|link|img|iframe)[^>]*?(?:src|href)="([^"]*)"', body)
    assert page.count('class="plotly-graph-div"') >= 5


@pytest.mark.parametrize(
    "title",
    [
        "Ranked designs", "Pareto front", "Parallel coordinates", "Main effects", "Curves of the best designs",
        "force [N] over friction", "Side by side", "Comparison", "What failed", "Where this comes from",
    ],
)  # fmt: skip
def test_it_has_every_part(page: str, title: str) -> None:
    assert re.search(rf"<h2>{re.escape(title)}", page)


def test_the_best_is_first_with_its_uncertainty(page: str) -> None:
    """6, 10 and 11 are the front (ripple 0.10, 0.11, 0.12; most force each); 11 beats 8; two frictions."""
    table = page[page.index("Ranked designs") :]
    assert "<td>14 (13 to 15)</td>" in table[: table.index("</table>")]
    assert max(table.index(f"design {number}<") for number in (6, 10, 11)) < table.index("design 8<")


def test_what_is_not_told_apart_shares_a_rank_and_says_so(tmp_path: Path, monkeypatch) -> None:
    """With 50 % of numerical error in force, and none known in ripple, 11 and 8 differ in nothing: both have 0.12."""
    monkeypatch.setattr(sweep_report, "errors_of", lambda study, sessions: {"force_N": ScoreError(relative=0.5)})
    path, rows = report_sweep(_fill(tmp_path), designs=("11", "8"))
    page = path.read_text(encoding="utf-8")
    table = page[page.index("Ranked designs") :]
    assert re.search(r"<td>\d+ =</td><td>design 11</td>", table)
    assert "<td>14 (13 to 15) ± 7</td>" in table
    assert "Nobody measured the numerical error of ripple fraction" in table
    force = next(row for row in rows if row["score"] == "force_N" and row["design"] == "design 8")
    assert force["difference"] == pytest.approx(-3) and not force["told_apart"]


def test_failures_are_counted_and_text_cannot_run(page: str) -> None:
    assert "<td>too &lt;i&gt;thin&lt;/i&gt;</td>" in page
    assert "4 jobs failed or diverged" in page
    assert "Pads &lt;b&gt;wet&lt;/b&gt;" in page


def test_designs_are_compared_by_number_or_name(tmp_path: Path) -> None:
    folder = _fill(tmp_path)
    _, rows = report_sweep(folder, designs=("0", "design 3"))
    force = {row["design"]: row for row in rows if row["score"] == "force_N"}
    assert force["design 0"]["mean"] == pytest.approx(3)
    assert force["design 3"]["difference"] == pytest.approx(3)
    assert force["design 3"]["difference_low"] == pytest.approx(3), "it differs by as much under each condition"
    for designs in (("0", "77"), ("0",)):
        with pytest.raises(InvalidOptionError):
            report_sweep(folder, designs=designs)


@pytest.mark.parametrize("changes", [{"objectives": []}, {"conditions": {"friction": [0.2], "speed": [0.0325]}}])
def test_a_sweep_without_objectives_or_of_one_condition_has_a_report_too(tmp_path: Path, changes: dict) -> None:
    assert report_sweep(_fill(tmp_path, **changes))[0].is_file()


def test_a_folder_without_a_sweep_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnreadableFileError, match="holds no sweep"):
        report_sweep(tmp_path)
