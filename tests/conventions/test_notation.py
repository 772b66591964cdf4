"""The glossary is of this code: its identifiers exist, and its terms stand once."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]
CODE = [*(TOP / "src").glob("*/*/**/*.py"), *(TOP / "src").glob("*/*/**/*.yaml")]
ROWS = re.findall(r"^\| ([^|]+) \| ([^|]+) \| [^|]+ \|$", (TOP / "docs/notation.md").read_text(), re.MULTILINE)
IDENTIFIERS = sorted({name for _, column in ROWS for name in re.findall(r"`([^`]+)`", column)})


@pytest.fixture(scope="module")
def words():
    """Every word of the code, and the names of its modules and packages."""
    text = {word for file in CODE for word in re.findall(r"\w+", file.read_text())}
    return text | {part for file in CODE for part in (file.stem, file.parent.name)}


@pytest.mark.parametrize("identifier", IDENTIFIERS)
def test_an_identifier_of_the_glossary_is_in_the_code(words, identifier):
    assert set(identifier.split(".")) <= words


def test_a_term_stands_once():
    terms = [term for term, _ in ROWS if term not in ("symbol", "term")]
    assert sorted(terms) == sorted(set(terms))
    assert len(terms) > 40
