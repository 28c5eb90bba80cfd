# SPDX-License-Identifier: Apache-2.0
"""Where configuration files are found: as given, in the source tree, in an installation, in a workspace."""

import sys

import pytest

from haptic_device import config_files


@pytest.fixture
def prefixes(tmp_path, monkeypatch):
    """An installation and a workspace, each with a scene of its own."""
    for prefix, scene in (("venv", "installed"), ("workspace", "built")):
        folder = tmp_path / prefix / config_files.INSTALLED / "scenes"
        folder.mkdir(parents=True)
        (folder / f"{scene}.yaml").write_text(f"from: {prefix}\n")
        (folder / "both.yaml").write_text(f"from: {prefix}\n")
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "venv"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'none'}:{tmp_path / 'workspace'}")
    return tmp_path


def test_a_path_that_exists_is_taken_as_it_is(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("")
    assert config_files.find("scenes", path) == path


def test_a_name_is_found_in_the_source_tree():
    path = config_files.find("scenes", "peg_in_hole")
    assert path.is_file()
    assert path.parts[-3:] == ("config", "scenes", "peg_in_hole.yaml")


def test_a_name_is_found_in_an_installation_and_in_a_workspace_the_former_first(prefixes):
    assert "venv" in config_files.find("scenes", "installed").parts
    assert "workspace" in config_files.find("scenes", "built").parts
    assert "venv" in config_files.find("scenes", "both").parts


def test_the_names_of_all_places_are_listed_once_each(prefixes):
    names = config_files.names("scenes")
    assert {"installed", "built", "both", "peg_in_hole"} <= set(names)
    assert names == sorted(set(names))


def test_an_unknown_name_is_refused_with_the_names_there_are(prefixes):
    with pytest.raises(FileNotFoundError) as caught:
        config_files.find("scenes", "peg_in_hoel")
    sentence = str(caught.value)
    assert sentence.startswith("peg_in_hoel is neither a file nor a name in config/scenes, which has ")
    assert sentence.endswith("more; did you mean peg_in_hole?")
    assert len(sentence.split("which has ")[1].split(", ")) == config_files.SHOWN


def test_a_name_that_is_like_none_is_refused_with_the_nearest_and_no_guess(prefixes):
    with pytest.raises(FileNotFoundError) as caught:
        config_files.find("scenes", "nonsense")
    assert str(caught.value).endswith(" more") and "did you mean" not in str(caught.value)


@pytest.mark.parametrize("count", [config_files.SHOWN, config_files.SHOWN + 1])
def test_six_names_are_all_listed_and_of_seven_one_is_counted(monkeypatch, count):
    monkeypatch.setattr(config_files, "names", lambda folder: [f"scene_{k}" for k in range(count)])
    with pytest.raises(FileNotFoundError) as caught:
        config_files.find("scenes", "nowhere")
    assert ("and 1 more" in str(caught.value)) == (count > config_files.SHOWN)


def test_an_empty_folder_is_said_to_be_empty():
    with pytest.raises(FileNotFoundError, match="name in config/nothing, which has no file at all"):
        config_files.find("nothing", "x")


def test_a_folder_named_like_a_scene_is_not_taken_for_it(tmp_path, monkeypatch):
    (tmp_path / "peg_in_hole").mkdir()
    monkeypatch.chdir(tmp_path)
    assert config_files.find("scenes", "peg_in_hole").suffix == ".yaml"
