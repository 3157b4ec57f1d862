"""List files over 500 lines and functions over 60, docstrings not counted.

A file or function that has a reason to be longer says so in a comment: `# long file: <reason>` within the first
20 lines of the file, `# long: <reason>` on the line of the `def`.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

MAX_FILE_LINES = 500
MAX_FUNCTION_LINES = 60
FOLDERS = ("swarm_forage_env", "baselines", "metrics", "tests", "scripts")
FILE_REASON = re.compile(r"#\s*long file:\s*\S")
FUNCTION_REASON = re.compile(r"#\s*long:\s*\S")
FILE_HEADER_LINES = 20


def _docstring_lines(tree: ast.AST) -> set[int]:
    """Return the line numbers of all strings that stand alone as statements: docstrings and field descriptions."""
    lines: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            lines.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines


def offenders(path: Path) -> Iterator[str]:
    """Yield one line of text per file or function of `path` that is too long and gives no reason."""
    source = path.read_text(encoding="utf-8")
    lines = source.splitlines()
    tree = ast.parse(source, filename=str(path))
    documentation = _docstring_lines(tree)
    length = len(lines) - len(documentation)
    excused = any(FILE_REASON.search(line) for line in lines[:FILE_HEADER_LINES])
    if length > MAX_FILE_LINES and not excused:
        yield f"{path}:1: file of {length} lines, at most {MAX_FILE_LINES}"
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            span = range(node.lineno, (node.end_lineno or node.lineno) + 1)
            length = len(span) - len(documentation.intersection(span))
            if length > MAX_FUNCTION_LINES and not FUNCTION_REASON.search(lines[node.lineno - 1]):
                yield f"{path}:{node.lineno}: {node.name}() of {length} lines, at most {MAX_FUNCTION_LINES}"


def main() -> int:
    """Print all offenders; return 1 when there are any."""
    root = Path(__file__).resolve().parent.parent
    paths = [path for folder in FOLDERS for path in sorted((root / folder).rglob("*.py"))]
    found = [text for path in paths for text in offenders(path)]
    for text in found:
        print(text)
    print(f"{len(paths)} files checked, {len(found)} too long")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
