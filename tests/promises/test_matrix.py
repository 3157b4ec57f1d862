"""The matrix of versions: what it takes for the oldest, and that a row comes into the page beside the others."""

from subprocess import CompletedProcess

from scripts import matrix

PAGE = "before\n\n<!-- table by scripts/matrix -->\n<!-- end of table -->\n\nafter\n"


def test_versions_are_compared_as_numbers():
    assert matrix.at_least("2.10.0", "2.9")
    assert matrix.at_least("2.0.0", "2.0")
    assert not matrix.at_least("1.26.4", "2.0")


def test_the_lowest_version_from_the_bound_on_that_has_a_wheel_is_taken(monkeypatch):
    def pip(words, **options):
        has_no_wheel = words[-1] == "thing==2.0.2"
        listed = "thing (2.1.1)\nAvailable versions: 2.1.1, 2.1.0, 2.1.0rc1, 2.0.3, 2.0.2, 1.26.4\n"
        return CompletedProcess(words, returncode=int(has_no_wheel), stdout=listed)

    monkeypatch.setattr(matrix.subprocess, "run", pip)
    assert matrix.oldest(["pip"], "thing", "2.0") == "2.0.3"
    assert matrix.oldest(["pip"], "thing", "2.1") == "2.1.0"


def test_every_package_that_is_varied_has_a_bound():
    assert set(matrix.lower_bounds()) == set(matrix.VARIED)


def test_a_row_comes_into_the_page_and_others_stay(tmp_path, monkeypatch):
    monkeypatch.setattr(matrix, "PAGE", tmp_path / "versions.md")
    matrix.PAGE.write_text(PAGE)
    matrix.write_row(("3.12", "newest"), ["1", "2", "3", "4", "done", "5 passed", "2026-01-02"])
    matrix.write_row(("3.11", "oldest"), ["1", "2", "3", "4", "done", "1 failed", "2026-01-01"])
    text = matrix.PAGE.read_text()
    assert text.index("| 3.11 | oldest | 1 | 2 | 3 | 4 | done | 1 failed | 2026-01-01 |") < text.index(
        "| 3.12 | newest |"
    )
    assert "Not run yet: Python 3.11, newest; Python 3.12, oldest; Python 3.13, oldest;" in text
    assert text.startswith("before\n")
    assert text.endswith("<!-- end of table -->\n\nafter\n")
