"""Rewrite the printed output in README.md and docs/ (``make docs``); review the diff before committing it."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from tests.pages import pages, renewed


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.renew_docs", description=__doc__)
    parser.add_argument("--page", action="append", type=Path, help="this page, may be repeated; default: all")
    for page in parser.parse_args().page or pages():
        with tempfile.TemporaryDirectory() as folder:
            text = renewed(page, Path(folder))
        if text != page.read_text(encoding="utf-8"):
            page.write_text(text, encoding="utf-8")
            print(f"renewed {page}")  # noqa: T201


if __name__ == "__main__":
    main()
