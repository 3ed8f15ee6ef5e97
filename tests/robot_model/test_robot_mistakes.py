"""Each kind of mistake in a robot file gives one error message with file, key and value."""

from __future__ import annotations

from pathlib import Path

import pytest
from robot_mistakes import FLEXIBLE, LOOSE, MISTAKES, VALID, Mistake

from robot_model import InputError, load_robot, robot_from_toml, shipped_robots


def refusal(path: Path | str) -> str:
    with pytest.raises(InputError) as caught:
        load_robot(path)
    return str(caught.value)


def test_the_files_that_the_mistakes_are_made_in_are_valid() -> None:
    assert robot_from_toml(VALID).name == "arm"
    assert robot_from_toml(FLEXIBLE).flexible_links
    assert robot_from_toml(LOOSE).joint("loose").clearance


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake.kind)
def test_sentence(mistake: Mistake, tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(mistake.text)
    assert refusal(path) == mistake.told_of(path)


def test_missing_file_suggests_the_nearest(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text(VALID)
    message = refusal(tmp_path / "arn.toml")
    assert "arn.toml is neither a file nor a shipped robot; did you mean" in message
    assert message.endswith("arm.toml'?")


def test_misspelt_shipped_robot() -> None:
    assert refusal("two_link_arn") == (
        "two_link_arn is neither a file nor a shipped robot; did you mean 'two_link_arm'?"
    )


def test_an_unknown_name_lists_the_shipped_robots() -> None:
    assert refusal("q" * 20) == (
        f"{'q' * 20} is neither a file nor a shipped robot; the shipped robots are "
        f"{', '.join(shipped_robots())}."
    )


def test_folder(tmp_path: Path) -> None:
    assert f"{tmp_path} is a folder, not a robot file" in refusal(tmp_path)


@pytest.mark.parametrize("name", ["x" * 5000, "a\0b", "a\nb", "", "no/such/folder/arm.toml"])
def test_names_that_are_invalid_for_files(name: str) -> None:
    assert refusal(name).isprintable()


def test_empty_file(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text("")
    assert refusal(tmp_path / "arm.toml").endswith("arm.toml: key 'name' is missing.")


def test_binary_file(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_bytes(b"name = \xff\xfe")
    assert refusal(tmp_path / "arm.toml").endswith(
        "arm.toml is not a text file: byte 7 is not UTF-8; save it as UTF-8."
    )


def test_huge_file_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "arm.toml").open("wb") as file:
        file.truncate(3 * 2**30)  # sparse: takes no room
    assert refusal(tmp_path / "arm.toml").endswith(
        "arm.toml has 3072 MiB, which is no robot file; one may have 16 MiB."
    )


def test_unreadable_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def denied(*_: object, **__: object) -> str:
        raise PermissionError(13, "Permission denied")  # the tests may run as root, who reads everything

    (tmp_path / "arm.toml").write_text(VALID)
    monkeypatch.setattr(Path, "open", denied)
    assert refusal(tmp_path / "arm.toml").endswith("arm.toml cannot be read: Permission denied.")


def test_an_error_is_one_line_with_one_closing_mark() -> None:
    assert str(InputError("what\nwhere..")) == "what where."
    assert str(InputError("did you mean 'a'?.")) == "did you mean 'a'?"
    assert str(InputError(str(InputError("said twice")))) == "said twice."
    assert str(InputError("a\x1b[31mb")) == "a\\x1b[31mb."
