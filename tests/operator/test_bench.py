"""``aerial bench``: its contract on the command line."""

import json

import pytest


@pytest.fixture(scope="module")
def benched(aerial_process, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    options = ("--sections", "variants", "--motions", "jump", "--repeats", 1, "--interpreted", "--out", folder)
    return aerial_process("bench", "planner", *options, "--json"), folder


def test_bench_measures_every_variant_with_and_without_warm_start(benched):
    ended, _ = benched
    assert ended.status == 0
    rows = ended.figures["rows"]
    assert [(row["variant"], row["warm_start"]) for row in rows] == [
        (variant, warm) for variant in ("KD", "AAKD", "AAKD*") for warm in (False, True)
    ]
    assert all(row["section"] == "variants" and row["motion"] == "jump" for row in rows)
    assert all(row["solved"] == 1 and row["total_time_s"]["p50"] > 0 for row in rows)


def test_bench_keeps_every_key(benched, missing_keys):
    assert missing_keys("bench_planner", benched[0].figures) == []


def test_bench_says_what_it_was_measured_on(benched):
    ended, _ = benched
    assert ended.figures["machine"].keys() >= {"processor", "cores", "load", "threads", "python", "versions"}


def test_bench_leaves_its_figures_in_a_file(benched):
    ended, folder = benched
    assert json.loads((folder / "planner.json").read_text()) == ended.figures


def test_bench_shows_progress(benched):
    ended, _ = benched
    assert "variants of jump: 1 of 1" in ended.errors


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["bench"], 2, "WHAT"),
        (["bench", "robot"], 2, "planner"),
        (["bench", "planner", "--sections", "varants"], 2, "did you mean 'variants'"),
        (["bench", "controller", "--sections", "variants"], 2, "there are ticks, solvers"),
        (["bench", "planner", "--motions", "jmup"], 1, "did you mean 'jump'"),
        (["bench", "planner", "--repeats", "0"], 1, "expected at least 1, found 0"),
        (["bench", "planner", "--goals", "-1"], 1, "expected at least 1, found -1"),
        (["bench", "runs", "--only", "30"], 2, "there are runs 0 to 29, found 30"),
        (["bench", "runs", "--only", "first"], 2, "expected numbers such as 0,5,9"),
        (["bench", "runs", "--against", "no_such_file"], 1, "no_such_file: cannot be read"),
    ],
)
def test_what_cannot_be_measured_is_one_sentence(aerial, arguments, status, words):
    ended = aerial(*arguments)
    assert ended.status == status
    assert words in ended.errors
    assert "Traceback" not in ended.errors


@pytest.mark.parametrize(("what", "peer"), [("planner", "crocoddyl"), ("controller", "tsid")])
def test_a_peer_that_is_asked_for_but_absent_is_one_sentence(aerial, monkeypatch, tmp_path, what, peer):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    ended = aerial("bench", what, "--sections", peer)
    assert ended.status == 1
    assert "--with-peers" in ended.errors
    assert ended.errors.count("\n") == 1


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_measured(aerial, tmp_path):
    (tmp_path / "file").write_text("")
    ended = aerial("bench", "planner", "--sections", "variants", "--out", tmp_path / "file" / "folder")
    assert ended.status == 1
    assert "cannot be written" in ended.errors
    assert ended.errors.count("\n") == 1


@pytest.fixture(scope="module")
def fingerprinted(aerial_process, tmp_path_factory):
    """A short list of runs, and what was found of it."""
    folder = tmp_path_factory.mktemp("runs")
    (folder / "list.yaml").write_text("runs: [{robot: mini_cheetah, motion: jump, displacement: [0.2, 0.0, 0.0]}]")
    options = ("--list", folder / "list.yaml", "--out", folder)
    return aerial_process("bench", "runs", *options, "--json"), folder


def test_bench_runs_finds_equal_runs_equal(fingerprinted, aerial_process):
    ended, folder = fingerprinted
    assert ended.status == 0
    assert ended.figures["rows"][0]["landing"]["landed"]
    options = ("--list", folder / "list.yaml", "--against", folder / "runs.json", "--out", folder / "again")
    again = aerial_process("bench", "runs", *options)
    assert again.status == 0
    assert "1 of 1 are as before, to the last bit" in again.output


def test_bench_runs_fails_and_names_what_differs(fingerprinted, aerial_process, tmp_path):
    ended, folder = fingerprinted
    rows = [{**ended.figures["rows"][0], "commands": "other"}]
    (tmp_path / "before.json").write_text(json.dumps({"rows": rows}))
    options = ("--list", folder / "list.yaml", "--against", tmp_path / "before.json", "--out", tmp_path, "--json")
    differs = aerial_process("bench", "runs", *options)
    assert differs.status == 1
    assert list(differs.figures["differing"].values()) == [["commands"]]
