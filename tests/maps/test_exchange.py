"""Maps travel through the thesis's text, CSV and JSON, and errors name file, line and what was expected."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from mcap_landmarks.errors import MapError, UsageError
from mcap_landmarks.maps import exchange_csv, exchange_json, exchange_thesis
from mcap_landmarks.maps.exchange import Format, export_map, format_of, import_map, read_text
from mcap_landmarks.maps.model import LandmarkMap
from mcap_landmarks.resources import resource

from tests.maps.examples import assert_same_map, small_map

DATA = Path(__file__).parents[1] / "data"
APPENDIX_C, APPENDIX_D = DATA / "thesis_appendix_c.txt", DATA / "thesis_appendix_d.txt"


def confirmed(landmark_map: LandmarkMap) -> LandmarkMap:
    """What CSV carries of `small_map`."""
    keep = ~landmark_map.tentative
    return LandmarkMap(
        landmark_map.ids[:3],
        landmark_map.classes[:3],
        landmark_map.positions_xy[keep],
        landmark_map.covariances[keep],
        landmark_map.radii_m[keep],
        landmark_map.sightings[keep],
        landmark_map.tentative[keep],
    )


def test_appendix_c_comes_back_to_the_letter(tmp_path: Path) -> None:
    landmark_map = import_map(APPENDIX_C, Format.THESIS)
    export_map(tmp_path / "c.txt", landmark_map, Format.THESIS)
    assert (tmp_path / "c.txt").read_text() == APPENDIX_C.read_text()


def test_appendix_c_is_read_in_order() -> None:
    landmark_map = import_map(APPENDIX_C, Format.THESIS)
    assert (len(landmark_map), len(landmark_map.groups)) == (60, 20)
    assert landmark_map.groups[1].landmark_ids == ("g2.1", "g2.2", "g2.3")
    assert landmark_map.classes[3:6] == ("person", "fire hydrant", "suitcase")
    np.testing.assert_array_equal(landmark_map.positions_xy[3], [-43.5898, 14.7212])
    np.testing.assert_array_equal(landmark_map.groups[1].map_from_base, [-32.7728, 17.6317, -3.1406])
    assert (landmark_map.sightings == 1).all()


def test_appendix_d_comes_back_to_the_letter() -> None:
    results = exchange_thesis.parse_results(read_text(APPENDIX_D), "d")
    assert exchange_thesis.render_results(results) == APPENDIX_D.read_text()
    assert results.classes[8] == ("person", "fire hydrant", "fire hydrant")
    np.testing.assert_array_equal(results.reference_xy[9], [34.1321, 4.6])
    np.testing.assert_array_equal(results.estimate_xy[9], [34.1474, 4.3893])


def test_an_object_of_two_groups_is_one_landmark() -> None:
    text = exchange_thesis.render_map(small_map())
    found = exchange_thesis.parse_map(text.replace("1 [", "[").replace("2 [", "\n["), "map.txt")
    assert found.ids == ("g1.1", "g1.2", "g1.3")
    assert found.sightings.tolist() == [1, 2, 2]
    assert found.groups[1].landmark_ids == ("g1.3", "g1.2")


@pytest.mark.parametrize(
    "line",
    [
        "[['person', 1, 2], ['robot', 1, 2]]",
        "[['person', 1, '2'], ['robot', 1, 2, 3]]",
        "[['person', 1, True], ['robot', 1, 2, 3]]",
        "[['person', 1e999, 2], ['robot', 1, 2, 3]]",
        f"[['person', 1{'0' * 400}, 2], ['robot', 1, 2, 3]]",
        "[[7, 1, 2], ['robot', 1, 2, 3]]",
        "[['robot', 1, 2, 3]]",
        "['robot', 1, 2, 3]",
        "[['person', 1, 2], ['robot', 1, 2, 3]",
        "[['person', 1, 2], ['robot', 1, 2, 3]] and more",
        "('person', 1, 2)",
        "__import__('os')",
        "[" * 5000,
    ],
)
def test_a_malformed_group_is_named(line: str) -> None:
    with pytest.raises(MapError, match=r"^my\.txt, line 3: expected \[\['class', x, y\]"):
        exchange_thesis.parse_map(f"[['person', 1, 2], ['robot', 1, 2, 3]]\n\n{line}\n", "my.txt")


def test_other_trouble_with_the_thesis_texts() -> None:
    with pytest.raises(MapError, match="line 1: the same object twice"):
        exchange_thesis.parse_map("[['a', 1, 2], ['a', 1, 2], ['robot', 1, 2, 3]]", "m")
    with pytest.raises(MapError, match="m: holds no group"):
        exchange_thesis.parse_map("\n", "m")
    with pytest.raises(MapError, match="m: holds no result"):
        exchange_thesis.parse_results("", "m")
    with pytest.raises(MapError, match=r"no groups, .* export it as CSV"):
        exchange_thesis.render_map(replace(small_map(), groups=()))


@pytest.mark.parametrize("line", ["[['a'], [1, 2], [3]]", "[[], [1, 2], [3, 4]]", "[['a'], [1, 2]]", "7"])
def test_a_malformed_result_is_named(line: str) -> None:
    with pytest.raises(MapError, match=r"^my\.txt, line 1: expected \[\['class', \.\.\.\], \[reference"):
        exchange_thesis.parse_results(line, "my.txt")


def test_csv_keeps_the_confirmed_landmarks_to_the_bit() -> None:
    text = exchange_csv.render(small_map())
    found = exchange_csv.parse(text, "map.csv")
    assert_same_map(replace(found, sources=()), confirmed(small_map()))
    assert text.splitlines()[:2] == [
        "id,class,x_m,y_m,var_x_m2,cov_xy_m2,var_y_m2,radius_m,sightings",
        "a,fire hydrant,1.0,2.0,0.04,0.01,0.09,0.15,12",
    ]


NAMES = ("=1+2", "+1", "-1", "@x", "\tx", "\rx", "'=x", "''-x", "'x", "x=1", "a,b", "\u96c6")


def test_csv_has_no_formulas_and_gives_back_every_name() -> None:
    """A spreadsheet shows what it opens as text, whatever a log called its objects; import takes the mark away."""
    count = len(NAMES)
    zeros = np.zeros(count)
    numbers = (
        np.full((count, 2), -1.5),
        np.zeros((count, 2, 2)),
        zeros,
        zeros.astype(np.int64),
        zeros.astype(np.bool_),
    )
    text = exchange_csv.render(LandmarkMap(NAMES, NAMES[::-1], *numbers))
    rows = list(csv.reader(io.StringIO(text, newline="")))[1:]
    assert not [cell for row in rows for cell in row[:2] if cell[0] in "=+-@\t\r"]
    assert {row[2] for row in rows} == {"-1.5"}, "numbers stay numbers"
    assert rows[8][0] == "'x", "what is no formula stays as it is"
    found = exchange_csv.parse(text, "map.csv")
    assert (found.ids, found.classes) == (NAMES, NAMES[::-1])


def test_csv_needs_only_four_columns_in_any_order() -> None:
    found = exchange_csv.parse('y_m,x_m,id,class\r\n2,1,p,"stop, sign"\r\n\r\n4,3,q,person\r\n', "map.csv")
    assert found.classes == ("stop, sign", "person")
    np.testing.assert_array_equal(found.positions_xy, [[1, 2], [3, 4]])
    assert not found.covariances.any()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "m, line 1: expected the columns id,class,x_m"),
        ("id,class,x_m\n", "m, line 1: expected the columns"),
        ("id,class,x_m,y_m,colour\n", "m, line 1: expected the columns"),
        ("id,class,x_m,y_m\n", "m: holds no landmark"),
        ("id,class,x_m,y_m\na,b,1\n", "m, line 2: expected 4 values, found 3"),
        ("id,class,x_m,y_m\na,b,1,far\n", "m, line 2: expected a number as y_m, found 'far'"),
        ("id,class,x_m,y_m\na,b,1,\n", "m, line 2: expected a number as y_m, found ''"),
        ("id,class,x_m,y_m\na,b,1,nan\n", "m, line 2: expected a finite number as y_m"),
        ("id,class,x_m,y_m\n,b,1,2\n", "m, line 2: expected an id and a class"),
        ("id,class,x_m,y_m\na,b,1,2\na,b,1,2\n", "m, line 3: the id a is also on line 2"),
        ('id,class,x_m,y_m\n"a"b,b,1,2\n', "m, line 2: is not CSV"),
        ("id,class,x_m,y_m,sightings\na,b,1,2,1.5\n", "m, line 2: expected a count as sightings, found 1.5"),
        ("id,class,x_m,y_m,radius_m\na,b,1,2,-1\n", "m: landmark a: radius"),
    ],
)
def test_a_malformed_csv_is_named(text: str, complaint: str) -> None:
    with pytest.raises(MapError) as caught:
        exchange_csv.parse(text, "m")
    assert str(caught.value).startswith(complaint)


def test_json_keeps_everything_and_fits_its_schema(tmp_path: Path) -> None:
    export_map(tmp_path / "m.json", small_map(), Format.JSON)
    assert_same_map(import_map(tmp_path / "m.json", Format.JSON), small_map())
    schema = json.loads(resource("schemas", "json/landmarks.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(json.loads((tmp_path / "m.json").read_text()), schema)


def test_a_malformed_json_is_named() -> None:
    document = exchange_json.document(small_map())
    with pytest.raises(MapError, match=r"m, document: Invalid JSON: .* line 2"):
        exchange_json.parse('{\n "schema": oops}', "m")
    document["landmarks"][2]["x_m"] = "far"
    with pytest.raises(MapError, match=r"^m, landmarks\.2\.x_m: Input should be a valid number"):
        exchange_json.parse(json.dumps(document), "m")
    document["landmarks"][2]["x_m"] = float("nan")
    with pytest.raises(MapError, match=r"^m, landmarks\.2\.x_m: Input should be a finite number"):
        exchange_json.parse(json.dumps(document), "m")
    document["landmarks"][2].update(x_m=1, id="a")
    with pytest.raises(MapError, match=r"^m: landmark ids are empty or not unique"):
        exchange_json.parse(json.dumps(document), "m")


def test_formats_go_by_name(tmp_path: Path) -> None:
    assert [format_of(Path(name)) for name in ("a.txt", "b.CSV", "c.json")] == list(Format)
    with pytest.raises(UsageError, match=r"m\.yaml: the name does not tell the format"):
        format_of(Path("m.yaml"))
    export_map(tmp_path / "m.csv", small_map(), Format.CSV)
    assert len(import_map(tmp_path / "m.csv", Format.CSV)) == 3


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="cannot be read"):
        read_text(tmp_path / "none.txt")
    (tmp_path / "latin.txt").write_bytes(b"caf\xe9")
    with pytest.raises(MapError, match=r"not text in UTF-8 \(byte 3\)"):
        read_text(tmp_path / "latin.txt")
