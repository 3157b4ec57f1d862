"""Check four habits: ignores have reasons, private names stay in their file, lengths, CONTRIBUTING maps every folder.

- A `noqa`, `type: ignore` or `pyright: ignore` names its rules and says why, on the same line or, for a setting of a
  whole file, in the line above.
- A name with a leading underscore is not imported from another file, nor taken from an imported module.
- A file has at most 500 lines and a function at most 60, docstrings not counted. One that has to be longer says why
  in a comment: `# long file: <reason>` within the first 20 lines of the file, `# long: <reason>` on the line of the
  `def`.
- The map "Where things are" in CONTRIBUTING.md names every folder of the tree, and no other.
"""

import ast
import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("swarm_forage_env", "baselines", "metrics", "tests", "scripts")
IGNORE = re.compile(
    r"#\s*(?:noqa: [A-Z0-9, ]+[0-9]|type: ignore\[[\w, -]+\]|pyright: (?:ignore\[\w+\]|\w+=\w+))(?P<rest>.*)"
)
LETTERS = re.compile(r"[A-Za-z]{2}")
MAP_HEADING = "## Where things are"
MAX_FILE_LINES = 500
MAX_FUNCTION_LINES = 60
FILE_REASON = re.compile(r"#\s*long file:\s*\S")
FUNCTION_REASON = re.compile(r"#\s*long:\s*\S")
FILE_HEADER_LINES = 20


def ignores_without_reason(source: str) -> Iterator[tuple[int, str]]:
    """Yield line number and comment of every ignore that does not say why."""
    lines = source.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT or not re.match(r"#\s*(noqa|type: ignore|pyright:)", token.string):
            continue
        found = IGNORE.match(token.string)
        line = token.start[0]
        above = lines[line - 2].startswith("# ") if line > 1 and lines[line - 1].startswith("#") else False
        if found is None or not (LETTERS.search(found["rest"]) or above):
            yield line, token.string


def private_imports(tree: ast.AST, *, of_tests: bool) -> Iterator[tuple[int, str]]:
    """Yield line number and name of everything private that is taken from a module of ours.

    A test may reach into a module that it imports, to replace something there for example.
    """
    modules: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.level or (node.module or "").split(".")[0] in FOLDERS):
            modules |= {alias.asname or alias.name for alias in node.names if alias.name.islower()}
            for alias in node.names:
                if alias.name.startswith("_") and not alias.name.startswith("__") and alias.name != "_internal":
                    yield node.lineno, alias.name
        elif isinstance(node, ast.Import):
            modules |= {alias.asname for alias in node.names if alias.asname and alias.name.split(".")[0] in FOLDERS}
    if of_tests:
        return
    shadowed = {argument.arg for node in ast.walk(tree) if isinstance(node, ast.arguments)
                for argument in (*node.posonlyargs, *node.args, *node.kwonlyargs)}  # fmt: skip
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Attribute)
            and re.match(r"_[^_]", node.attr)
            and isinstance(node.value, ast.Name)
            and node.value.id in modules - shadowed
        ):
            yield node.lineno, f"{node.value.id}.{node.attr}"


def _docstring_lines(tree: ast.AST) -> set[int]:
    """Return the line numbers of all strings that stand alone as statements: docstrings and field descriptions."""
    lines: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            lines.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines


def too_long(name: Path, source: str, tree: ast.AST) -> Iterator[str]:
    """Yield one line of text per file or function that is too long and gives no reason."""
    lines = source.splitlines()
    documentation = _docstring_lines(tree)
    length = len(lines) - len(documentation)
    excused = any(FILE_REASON.search(line) for line in lines[:FILE_HEADER_LINES])
    if length > MAX_FILE_LINES and not excused:
        yield f"{name}:1: file of {length} lines, at most {MAX_FILE_LINES}"
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            span = range(node.lineno, (node.end_lineno or node.lineno) + 1)
            length = len(span) - len(documentation.intersection(span))
            if length > MAX_FUNCTION_LINES and not FUNCTION_REASON.search(lines[node.lineno - 1]):
                yield f"{name}:{node.lineno}: {node.name}() of {length} lines, at most {MAX_FUNCTION_LINES}"


def folders_of_the_tree() -> set[str]:
    """Return the folders that hold tracked or new files, "tests/world" for example."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", *FOLDERS],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    parents = {parent for path in listed if (ROOT / path).exists() for parent in Path(path).parents}
    return {path.as_posix() for path in parents if path != Path()}


def folders_of_the_map(text: str) -> set[str]:
    """Return the folders that the map names: a line "  world/  ..." below "swarm_forage_env/  ..."."""
    block = text.split(MAP_HEADING, 1)[1].split("```", 2)[1]
    above: list[tuple[int, str]] = []
    found: set[str] = set()
    for line in block.splitlines():
        match = re.match(r"( *)((?:[\w.]+/ )*[\w./]+/)(?: |$)", line)
        if match is None:
            continue
        indent = len(match[1])
        above = [(depth, name) for depth, name in above if depth < indent]
        for name in match[2].split():
            found.add("/".join([*(parent for _, parent in above), name.rstrip("/")]))
        above.append((indent, match[2].split()[-1].rstrip("/")))
    return found


def offences() -> Iterator[str]:
    """Yield one line of text per offence."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            source = path.read_text(encoding="utf-8")
            tree, name = ast.parse(source), path.relative_to(ROOT)
            for line, comment in ignores_without_reason(source):
                yield f"{name}:{line}: expected a rule and a reason behind it, got {comment}"
            for line, private in private_imports(tree, of_tests=folder == "tests"):
                yield f"{name}:{line}: {private} is private to another file; give it a public name there"
            yield from too_long(name, source, tree)
    there, mapped = folders_of_the_tree(), folders_of_the_map((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))
    for folder in sorted(there - mapped):
        yield f"CONTRIBUTING.md: {folder}/ is missing in the map"
    for folder in sorted(mapped - there):
        yield f"CONTRIBUTING.md: {folder}/ is in the map, but not in the tree"


def main() -> int:
    """Print all offences; return 1 when there are any."""
    found = list(offences())
    for text in found:
        print(text)
    print(f"{len(found)} habits broken")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
