# SPDX-FileCopyrightText: 2026 D2-LIO contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the tables of an ablation say, and their exports."""

from __future__ import annotations

import csv
import io
import re

import pytest
from d2lio.ablate.results import ResultRow
from d2lio.ablate.tables import POOLED_ID, Cell, Table, build, paper_table, to_text
from d2lio.errors import DataError
from d2lio.report.exports import to_csv, to_latex, to_markdown, write_tables
from fake_results import SEQUENCES, results, row

WOBBLE = (1.00, 1.02, 0.98, 1.01, 0.99)
NAMES = [str(s["name"]) for s in SEQUENCES]


def rows_of(sequence: str, variant: str, scale: float, failed: int = 0) -> list[ResultRow]:
    return [
        row(sequence, k, variant, None if k < failed else scale * w) for k, w in enumerate(WOBBLE)
    ]


def table_of(*cells: tuple[str, str, float, int], **changes: object) -> Table:
    rows = [r for sequence, variant, scale, failed in cells
            for r in rows_of(sequence, variant, scale, failed)]  # fmt: skip
    tables = build(results(rows, **changes))
    assert len(tables) == 1
    return tables[0]


def texts(table: Table) -> dict[tuple[str, str], str]:
    return {key: cell.text for key, cell in table.cells.items()}


def bold(table: Table) -> set[tuple[str, str]]:
    return {key for key, cell in table.cells.items() if cell.bold}


def test_medians_failures_and_the_papers_numbers() -> None:
    table = table_of(
        ("Tunnel-2", "fastlio", 0.2, 0), ("Tunnel-2", "liosam", 0.3, 1),
        ("Tunnel-2", "d2lio", 0.1, 3), ("Tunnel-2", "voxelmap", 12.0, 0),
    )  # fmt: skip
    assert texts(table) == {
        ("Tunnel-2", "fastlio"): "0.200",
        ("Tunnel-2", "liosam"): "0.303 (1)",
        ("Tunnel-2", "d2lio"): "-",
        ("Tunnel-2", "voxelmap"): "-",
    }
    papers = {variant: cell.paper for (_, variant), cell in table.cells.items()}
    assert papers == {"fastlio": "0.14", "liosam": "0.13", "d2lio": "0.10", "voxelmap": ""}
    assert [h.id for h in table.columns] == ["fastlio", "liosam", "d2lio", "voxelmap"]
    assert table.cells["Tunnel-2", "voxelmap"].stats.failed_ate == 12.0  # its size is kept


def test_bold_is_better_than_the_baseline_and_best_or_not_separable_from_it() -> None:
    sequence = "Tunnel-2"
    assert bold(table_of((sequence, "fastlio", 0.2, 0), (sequence, "d2lio", 0.1, 0))) == {
        (sequence, "d2lio")
    }
    # Better than the baseline, but clearly behind the best.
    table = table_of(
        (sequence, "fastlio", 0.4, 0), (sequence, "liosam", 0.2, 0), (sequence, "d2lio", 0.1, 0)
    )
    assert bold(table) == {(sequence, "d2lio")}
    # The best is not told apart from the next: both are bold.
    rows = [r for v, s in (("fastlio", 0.4), ("d2lio", 0.1)) for r in rows_of(sequence, v, s)]
    rows += [row(sequence, k, "liosam", 0.1 * w) for k, w in enumerate((1.3, 0.8, 1.2, 0.9, 1.05))]
    (table,) = build(results(rows))
    assert bold(table) == {(sequence, "d2lio"), (sequence, "liosam")}


def test_nothing_is_bold_without_evidence() -> None:
    sequence = "Tunnel-2"
    alike = table_of((sequence, "fastlio", 0.1, 0), (sequence, "d2lio", 0.1, 0))
    worse = table_of((sequence, "fastlio", 0.1, 0), (sequence, "d2lio", 0.2, 0))
    no_baseline = table_of((sequence, "liosam", 0.2, 0), (sequence, "d2lio", 0.1, 0))
    few = [row(sequence, k, v, a) for k in range(4) for v, a in (("fastlio", 0.2), ("d2lio", 0.1))]
    assert not any(map(bold, (alike, worse, no_baseline, *build(results(few)))))
    assert "no baseline" in no_baseline.rules[-1]


def test_outlasting_a_failing_baseline_is_bold() -> None:
    table = table_of(("Tunnel-2", "fastlio", 0.1, 5), ("Tunnel-2", "d2lio", 0.1, 0))
    assert bold(table) == {("Tunnel-2", "d2lio")}
    assert "failed run, at the limit: 5" in "\n".join(table.cells["Tunnel-2", "d2lio"].tooltip)
    both = table_of(("Tunnel-2", "fastlio", 0.1, 5), ("Tunnel-2", "d2lio", 0.1, 5))
    assert bold(both) == set()


def test_the_rules_stand_below_the_table() -> None:
    rules = " ".join(table_of(("Tunnel-2", "fastlio", 0.2, 0)).rules)
    wanted = ("median of n = 5 runs", "95 %", "5 % of the path", "interval", "FAST-LIO2", "paper")
    for said in wanted:
        assert said in rules


def test_pooled_row_over_the_sequences() -> None:
    cells = [(name, v, s, 0) for name in NAMES for v, s in (("fastlio", 0.2), ("d2lio", 0.1))]
    table = table_of(*cells)
    assert [r.id for r in table.rows] == [*NAMES, POOLED_ID]
    assert [r.group for r in table.rows] == ["GEODE", "GEODE", "ECMD", "difference to FAST-LIO2"]
    assert texts(table)[POOLED_ID, "d2lio"] == "-50 %"
    assert (POOLED_ID, "fastlio") not in table.cells


def test_variants_as_rows() -> None:
    layout = {"rows": "variant", "columns": "sequence"}
    table = table_of(*((n, "fastlio", 0.2, 0) for n in NAMES), layout=layout)
    assert table.corner == "variant"
    assert [c.id for c in table.columns] == NAMES
    assert table.cell(table.rows[0], table.columns[0]).text == "0.200"


def test_blocks_by_group_have_baselines_of_their_own() -> None:
    variants = [
        {"id": f"{host}-{mode}", "title": mode, "group": host.upper(), "host": host}
        for host in ("fastlio", "liosam") for mode in ("none", "fixed")
    ]  # fmt: skip
    sequences = [SEQUENCES[0] | {"groups": ["FASTLIO"]}, SEQUENCES[1] | {"groups": ["LIOSAM"]}]
    rows = rows_of("Tunnel-2", "fastlio-none", 0.2) + rows_of("Tunnel-2", "fastlio-fixed", 0.1)
    rows += rows_of("Flat Ground", "liosam-none", 0.2) + rows_of("Flat Ground", "liosam-fixed", 0.1)
    first, second = build(
        results(rows, variants=variants, sequences=sequences, baseline="fastlio-none",
                layout={"blocks": "group"}, paper=None)
    )  # fmt: skip
    assert (first.baseline, second.baseline) == ("fastlio-none", "liosam-none")
    assert [r.id for r in first.rows] == ["Tunnel-2"]
    assert bold(second) == {("Flat Ground", "liosam-fixed")}
    assert second.title.endswith("LIOSAM")


def test_the_papers_tables_are_shipped() -> None:
    first, second = paper_table("table1.csv"), paper_table("table2.csv")
    assert (len(first), len(second)) == (6, 16)
    assert second[0]["D2-LIO"] == "0.10"
    assert first[4] == {
        "host": "LIO-SAM", "dataset": "ECMD", "sequence": "Bridge_day_medium_b",
        "none": "1.12", "fixed": "-", "kiss": "1.17", "point_adaptive": "1.14",
    }  # fmt: skip
    with pytest.raises(DataError, match=r"table3\.csv"):
        paper_table("table3.csv")


def test_the_papers_number_belongs_to_its_host() -> None:
    name = "Bridge_day_medium_b"
    sequences = [{"name": name, "simulate": {"scene": "bridge"}}]
    variants = [{"id": h, "host": h} for h in ("fastlio", "liosam")]
    paper = {"table": "table1.csv", "columns": {"fastlio": "none", "liosam": "none"}}
    table = table_of((name, "fastlio", 1.0, 0), (name, "liosam", 1.0, 0),
                     sequences=sequences, variants=variants, paper=paper)  # fmt: skip
    assert table.cells[name, "fastlio"].paper == ""
    assert table.cells[name, "liosam"].paper == "1.12"


@pytest.fixture
def whole() -> Table:
    of_each = (("fastlio", 0.2, 0), ("liosam", 0.3, 5), ("d2lio", 0.1, 0))
    cells = [(name, *cell) for name in NAMES for cell in of_each]
    return table_of(*cells)


def test_markdown(whole: Table) -> None:
    lines = [line for line in to_markdown(whole).splitlines() if line.startswith("|")]
    pipes = {len(re.findall(r"(?<!\\)\|", line)) for line in lines}
    assert pipes == {len(whole.columns) + 2}
    assert r"| Tunnel-2 | 0.200 / 0.14 | - / 0.13 | **0.100** / 0.10 |" in lines
    assert any(line.startswith(r"| Highway\_day\_easy\_a |") for line in lines)
    assert all(rule.split(":")[0] in to_markdown(whole) for rule in whole.rules)


def balanced(text: str) -> bool:
    depth = 0
    for brace in re.findall(r"(?<!\\)[{}]", text):
        depth += 1 if brace == "{" else -1
        if depth < 0:
            return False
    return depth == 0


def test_latex_rows_have_as_many_cells_as_columns(whole: Table) -> None:
    text = to_latex(whole)
    assert balanced(text)
    assert text.isprintable() or "\n" in text
    body = text[text.index(r"\toprule") : text.index(r"\bottomrule")].splitlines()
    rows = [line for line in body if line.endswith(r"\\")]
    assert len(rows) == 1 + len(whole.rows) + 3  # head, rows, group lines
    for line in rows:
        cells = re.split(r"(?<!\\)&", line)
        width = int(found.group(1)) if (found := re.match(r"\\multicolumn\{(\d)\}", line)) else 0
        assert len(cells) == (1 if width else 1 + len(whole.columns))
        assert width in (0, 1 + len(whole.columns))
        assert all(map(balanced, cells))
        assert not re.search(r"(?<!\\)[%#$_^]", line)
    assert text.count(r"\begin{") == text.count(r"\end{") == 2
    assert r"\textbf{\underline{0.100}} / 0.10" in text
    assert len(re.findall(r"\\begin\{tabular\}\{l(r+)\}", text)[0]) == len(whole.columns)


def test_latex_escapes_what_means_something_there() -> None:
    table = Table(r"a & b % _ {x} \ D² λ", "sequence", [], [])
    text = to_latex(table)
    assert balanced(text)
    assert r"a \& b \% \_ \{x\} \textbackslash{} D\textsuperscript{2} $\lambda$" in text


def test_csv_has_every_cell(whole: Table) -> None:
    lines = list(csv.DictReader(io.StringIO(to_csv(whole))))
    assert len(lines) == len(whole.cells)
    first = lines[2]
    assert (first["row"], first["column"], first["bold"]) == ("Tunnel-2", "D²-LIO", "1")
    assert float(first["difference_percent"]) == pytest.approx(-50.0)
    assert first["failures"] == "0"
    assert lines[1]["text"] == "-"
    assert lines[1]["median_m"] == ""


def test_plain_text_shows_bold_as_a_star(whole: Table) -> None:
    rows = [r for n in NAMES for v, s in (("fastlio", 0.2), ("d2lio", 0.1))
            for r in rows_of(n, v, s)]  # fmt: skip
    text = to_text(results(rows), width=100)
    assert "*0.100 / 0.10" in text
    assert "0.200 / 0.14" in text
    assert "Highway_day_easy_a" in text
    assert "*: better than FAST-LIO2" in text


def test_files_are_written_for_each_table(whole: Table, tmp_path) -> None:
    one = write_tables("t", [whole], tmp_path / "one")
    two = write_tables("t", [whole, whole], tmp_path / "two")
    assert [f.name for f in one] == ["t.md", "t.tex", "t.csv"]
    assert len({f.name for f in two}) == 6
    assert all(f.read_text() for f in one + two)


def test_an_empty_cell_stays_empty() -> None:
    table = table_of(("Tunnel-2", "fastlio", 0.2, 0), ("Flat Ground", "d2lio", 0.1, 0))
    flat = next(r for r in table.rows if r.id == "Flat Ground")
    assert table.cell(flat, table.columns[0]) == Cell()
    assert "| Flat Ground |  | 0.100 / - |" in to_markdown(table)
