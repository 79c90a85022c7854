"""`check` finds what is stale, and says what, where and how to mend it."""

import subprocess

import pytest

from soro_lib.project import slugs
from soro_lib.replication import datacards
from soro_lib.replication.findings import Finding
from soro_lib.replication.scorecard import build_scorecard
from soro_lib.workbook import check


def git(folder, *arguments):
    identity = ["-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "commit.gpgsign=false"]
    subprocess.run(["git", *identity, *arguments], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def project(tmp_path, write_paper):
    """A committed project with one table, one image, one scorecard and a README."""
    write_paper()
    folder = tmp_path / "figures" / "shared_control"
    folder.mkdir(parents=True)
    (folder / "table1.csv").write_text("name,error_mm,count\na,1.00000,3\nb,,4\n")
    (folder / "fig01.png").write_bytes(b"image")
    build_scorecard("paper", {"error": Finding(1.25)}).to_csv(folder / "scorecard.csv", index=False)
    blank = f"# T\n{check.summary.README_BEGIN}\n{check.summary.README_END}\nend\n"
    (tmp_path / "README.md").write_text(blank)
    check.update_readme(tmp_path)
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", "figures", "README.md")
    git(tmp_path, "commit", "-qm", "x")
    return tmp_path


def test_untouched_project_passes(project):
    assert check.figures(project) == []
    assert check.readme(project) == []


def test_a_changed_table_is_told_but_not_its_rounding(project):
    path = project / "figures" / "shared_control" / "table1.csv"
    path.write_text("name,error_mm,count\na,1.00005,3\nb,,4\n")
    assert check.figures(project) == []
    path.write_text("name,error_mm,count\na,1.01,3\nb,,4\n")
    (problem,) = check.figures(project)
    assert problem.startswith("figures/shared_control/table1.csv, a, error_mm: 1.00000 became 1.01; look why")


def test_missing_and_uncommitted_files_are_told(project):
    (project / "figures" / "shared_control" / "fig01.png").unlink()
    (project / "figures" / "shared_control" / "fig02.png").write_bytes(b"new")
    gone, new = check.figures(project)
    assert gone.startswith("figures/shared_control/fig01.png: a file became nothing;")
    assert new.startswith("figures/shared_control/fig02.png: nothing became a file;")


def test_without_git_the_check_says_so(tmp_path, monkeypatch):
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    with pytest.raises(RuntimeError, match="git archive failed"):
        check.figures(tmp_path)


def test_stale_readme_is_told_and_mended(project):
    path = project / "figures" / "shared_control" / "scorecard.csv"
    build_scorecard("paper", {"error": Finding(1.5, "physics")}).to_csv(path, index=False)
    assert "--update-readme" in check.readme(project)[0]
    check.update_readme(project)
    assert check.readme(project) == []
    assert (project / "README.md").read_text().endswith("\nend\n")
    (project / "README.md").write_text("no markers")
    assert "each marker exactly once" in check.readme(project)[0]


def test_missing_scorecards_are_told(tmp_path):
    problems = check.scorecards(tmp_path)
    assert len(problems) == len(slugs())
    assert all("missing; run `make figures`" in problem for problem in problems)


def test_data_without_card_or_changed_is_told(tmp_path):
    folder = tmp_path / "data" / "paper"
    folder.mkdir(parents=True)
    (folder / "published.csv").write_text("written by hand")
    (folder / "plant.toml").write_text("speaks = true")
    (folder / "run.csv").write_text("time\n1\n")
    assert "data/paper/run.csv.card.toml: no such card" in check.data(tmp_path)[0]
    columns = {"time": "[s] since start"}
    datacards.write_card(folder / "run.csv", description="x", columns=columns, generator="g", seed=1)
    assert check.data(tmp_path) == []
    (folder / "run.csv").write_text("time\n2\n")
    assert "data/paper/run.csv: SHA-256" in check.data(tmp_path)[0]
    (folder / "run.csv").unlink()
    assert "data/paper/run.csv: no such data file" in check.data(tmp_path)[0]


def test_main_prints_every_check_and_fails_when_one_does(monkeypatch, capsys):
    monkeypatch.setattr(check, "CHECKS", {"good": list, "bad": lambda: ["it is broken; mend it"]})
    assert check.main([]) == 1
    assert capsys.readouterr().out.split("\n")[:3] == [
        "ok     good",
        "FAILED bad",
        "       - it is broken; mend it",
    ]
    monkeypatch.setattr(check, "CHECKS", {"good": list})
    assert check.main([]) == 0
