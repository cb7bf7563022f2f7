"""The verdicts of a comparison of two sets of runs as JUnit XML, which CI services show beside other tests."""

import re
from collections.abc import Iterable
from typing import Literal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from mcap_landmarks.diff.set_document import LogEntry, SetDocument, VerdictEntry
from mcap_landmarks.diff.set_text import verdict_of, worst_of

_UNFIT = re.compile(r"[\0-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")
"""What XML 1.0 has no place for (section 2.2), line breaks, and what turns the direction of writing."""
_Outcome = Literal["failure", "error", "skipped"]
_OUTCOMES: dict[str, _Outcome] = {"failures": "failure", "errors": "error", "skipped": "skipped"}
"""What a suite counts, and what a test case says."""


def junit(document: SetDocument) -> bytes:
    """One test case per metric, per log and per condition, as Jenkins' schema (junit-10.xsd) has them.

    A metric without a verdict is skipped, unless it fails; a log that cannot be read is an error. No clock is in it.
    """
    root = Element("testsuites", name="mcap-landmarks diff")
    _suite(root, "metrics", (_metric(name, entry) for name, entry in document["metrics"].items()))
    logs = [_log(entry) for entry in document["logs"]]
    logs += [
        _case("logs", f"{entry['log']} ({entry['side']})", "error", entry["error"]) for entry in document["broken"]
    ]
    missing: _Outcome = "failure" if document["missing_fails"] else "skipped"
    logs += [_case("logs", name, missing, "the candidate lacks it") for name in document["unpaired"]["baseline"]]
    logs += [_case("logs", name, "skipped", "the baseline lacks it") for name in document["unpaired"]["candidate"]]
    _suite(root, "logs", logs)
    conditions = document["conditions"]
    if conditions:
        _suite(
            root,
            "conditions",
            (
                _case("conditions", one["condition"], "failure" if one["holds"] else None, f"it is {one['value']:.6g}")
                for one in conditions
            ),
        )
    indent(root)
    text: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _metric(name: str, entry: VerdictEntry) -> Element:
    outcome: _Outcome | None = "skipped" if entry["verdict"] == "inconclusive" else None
    return _case("metrics", name, "failure" if entry["fails"] else outcome, verdict_of(entry))


def _log(entry: LogEntry) -> Element:
    worst = worst_of(entry)
    told = "no metric that gates got worse" if worst is None else "{}: {} -> {}, {}".format(*worst)
    return _case("logs", entry["log"], "failure" if entry["fails"] else None, "; ".join([*entry["fails"], told]))


def _case(suite: str, name: str, outcome: _Outcome | None, words: str) -> Element:
    """A test case; `words` say why it did not pass, or stand beside it."""
    case = Element("testcase", classname=f"diff.{suite}", name=_fit(name), time="0")
    if outcome is None:
        SubElement(case, "system-out").text = _fit(words)
    else:
        SubElement(case, outcome, message=_fit(words))
    return case


def _suite(root: Element, name: str, cases: Iterable[Element]) -> None:
    found = list(cases)
    counts = {count: str(sum(case.find(kind) is not None for case in found)) for count, kind in _OUTCOMES.items()}
    suite = SubElement(root, "testsuite", {"name": name, "tests": str(len(found)), **counts, "time": "0"})
    suite.extend(found)


def _fit(text: str) -> str:
    return _UNFIT.sub(" ", text)
