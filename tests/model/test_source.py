"""The YAML reader: places, merges, and what is refused."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from cutjoint.model.document.source import MAX_BYTES, parse_yaml
from cutjoint.model.errors import ModelError
from cutjoint.model.read import read_model


def refusal(text: str) -> str:
    with pytest.raises(ModelError) as caught:
        parse_yaml(text, "m.yaml")
    return str(caught.value)


def test_values_and_keys_have_places() -> None:
    source = parse_yaml("a: 1\nb:\n  - {c: 2}\n", "m.yaml")
    assert source.data == {"a": 1, "b": ({"c": 2},)}
    assert str(source.value_span(("b", 0, "c"))) == "m.yaml:3:9"
    assert str(source.key_span(("b",))) == "m.yaml:2:1"
    assert str(source.value_span(("b", 7, "unknown"))) == "m.yaml:3:3"


def test_scalars_follow_yaml_1_2() -> None:
    text = "[1, -2, 010, 1e3, .5, 1.0e+4, true, no, 2020-01-01, 0x10, 1:30, ~, '7', null]"
    expected = (1, -2, 10, 1000.0, 0.5, 1e4, True, "no", "2020-01-01", "0x10", "1:30", None, "7", None)
    data = parse_yaml(text, "m.yaml").data
    assert data == expected
    assert [type(value) for value in data] == [type(value) for value in expected]


def test_merge_keys_and_aliases() -> None:
    text = "base: &b {x: 1, y: 2}\nother: &o {y: 5, z: 6}\none: {<<: *b, y: 3}\ntwo: {<<: [*b, *o]}\nthree: *b\n"
    source = parse_yaml(text, "m.yaml")
    assert source.data["one"] == {"x": 1, "y": 3}
    assert source.data["two"] == {"x": 1, "y": 2, "z": 6}
    assert source.data["three"] == {"x": 1, "y": 2}
    assert str(source.value_span(("one", "x"))) == "m.yaml:1:14"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "m.yaml:1:1: file: the file is empty; a model starts with 'cutjoint: 1'"),
        ("a: 1\na: 2", "m.yaml:2:1: file: duplicate key 'a', first defined at line 1; keep one of them"),
        ("a: .nan", "m.yaml:1:4: file: '.nan' is not a finite number"),
        ("a: -.inf", "m.yaml:1:4: file: '-.inf' is not a finite number"),
        ("a: 1e999", "m.yaml:1:4: file: '1e999' is not a finite number"),
        ("a: " + "9" * 25, "m.yaml:1:4: file: '9999999999999999999999999' is not a finite number"),
        ("a: !!python/object/apply:os.system [ls]",
         "m.yaml:1:4: file: the tag 'tag:yaml.org,2002:python/object/apply:os.system' is not allowed; "
         "a model file holds plain data only"),
        ("a: !secret 1",
         "m.yaml:1:4: file: the tag '!secret' is not allowed; a model file holds plain data only"),
        ("a: !!set {b}", "m.yaml:1:4: file: the tag 'tag:yaml.org,2002:set' is not allowed; "
         "a model file holds plain data only"),
        ("a: &a [*a]",
         "m.yaml:1:4: file: an alias stands inside the value it names; remove the recursive alias"),
        ("a: &a {b: {<<: *a}}",
         "m.yaml:1:4: file: an alias stands inside the value it names; remove the recursive alias"),
        ("a: {<<: 3}", "m.yaml:1:9: file: '<<' needs a mapping; write for example '<<: *name'"),
        ("[1]: 2", "m.yaml:1:1: file: a key must be a name, not a list or a mapping"),
        ("a: *b", "m.yaml:1:4: file: found undefined alias 'b'"),
        ("a: [1", "m.yaml:1:6: file: expected ',' or ']', but got '<stream end>'"),
        ("a: 1\n---\nb: 2", "m.yaml:2:1: file: but found another document"),
        ('a: "\\ud800"', "m.yaml:1:4: file: an escape is half of a character"),
        ('"\\udfff": 1', "m.yaml:1:1: file: an escape is half of a character"),
        ('a: "x\\U00110000"', "m.yaml:1:8: file: an escape names no character"),
        ('a: "\\UFFFFFFFF"', "m.yaml:1:7: file: an escape names no character"),
        ("a: \x07", "m.yaml:1:4: file: a control character is not allowed in YAML"),
    ],
)  # fmt: skip
def test_bad_yaml_is_named(text: str, expected: str) -> None:
    assert refusal(text) == expected


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("[" * 5000, "the file is nested deeper than 40 levels"),
        ("a: " + "[" * 60 + "]" * 60, "the file is nested deeper than 40 levels"),
        ("[" + "1," * 100_001 + "]", "the file is longer than 100000 values"),
        ("a0: &a0 [1,1,1,1,1,1,1,1,1,1]\n"
         + "".join(f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 9)),
         "aliases expand the file to more than 200000 values"),
        ("a0: &a0 {k: 1}\n" + "".join(f"a{i}: &a{i} {{k{i}: *a{i - 1}}}\n" for i in range(1, 60)),
         "aliases nest the file deeper than 40 levels"),
        ("#" * (MAX_BYTES + 1), "the file is larger than 4000000 bytes"),
    ],
)  # fmt: skip
def test_size_attacks_end_quickly(text: str, part: str) -> None:
    start = time.process_time()
    assert part in refusal(text)
    assert time.process_time() - start < 20


def test_merge_bombs_end_quickly() -> None:
    text = "a0: &a0 {k: 1}\n" + "".join(f"a{i}: &a{i} {{<<: [*a{i - 1}, *a{i - 1}, *a{i - 1}]}}\n" for i in range(1, 500))
    start = time.process_time()
    assert parse_yaml(text, "m.yaml").data["a499"] == {"k": 1}
    assert time.process_time() - start < 20


WIDE = "a: &a {" + ", ".join(f"k{i}: 1" for i in range(24_000)) + "}\n"


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (WIDE + "b:\n  <<: [" + ", ".join(["*a"] * 20_000) + "]\n", "m.yaml:3:3"),
        (WIDE + "".join(f"b{i}: {{<<: *a}}\n" for i in range(3000)), "m.yaml:1:"),
        ("a0: &a0 {k0: 1}\n" + "".join(f"a{i}: &a{i} {{k{i}: 1, <<: *a{i - 1}}}\n" for i in range(1, 5000)), "m.yaml:"),
    ],
)
def test_merge_keys_are_counted(text: str, place: str) -> None:
    found = refusal(text)
    assert found.startswith(place)
    assert "200000" in found


@pytest.mark.parametrize("last", ["*a4999", "[*a4999, *a0]"])
def test_long_chains_of_merge_keys_are_refused(last: str) -> None:
    """All mappings of the chain are merged into the one that contains them, the last of the chain first."""
    chain = ", ".join(f"k{i}: &a{i} {{<<: *a{i - 1}}}" for i in range(1, 5000))
    found = refusal(f"{{k0: &a0 {{x: 1}}, {chain}, <<: {last}}}")
    assert "merge keys lead over more than 80 mappings, each of which merges the next; write the entries into fewer mappings" in found


def test_what_is_refused_is_shown_without_control_characters() -> None:
    found = refusal('a: 1\n"\\e[31m": 1\n"\\e[31m": 2\n')
    assert found == r"m.yaml:3:1: file: duplicate key '\x1b[31m', first defined at line 2; keep one of them"
    assert len(refusal("!" * 1000)) < 400


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    missing = tmp_path / "none.yaml"
    with pytest.raises(ModelError, match=r"none.yaml:1:1: file: cannot be read: No such file or directory"):
        read_model(missing)
    latin = tmp_path / "latin.yaml"
    latin.write_bytes(b"a: 1\nb: \xe9\n")
    with pytest.raises(ModelError, match=r"latin.yaml:2:1: file: the file is not UTF-8 text"):
        read_model(latin)
    large = tmp_path / "large.yaml"
    large.write_bytes(b" " * (MAX_BYTES + 1))
    with pytest.raises(ModelError, match=r"large.yaml:1:1: file: the file is larger than 4000000 bytes"):
        read_model(large)
