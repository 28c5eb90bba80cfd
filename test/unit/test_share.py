# SPDX-License-Identifier: Apache-2.0
"""Where configuration files are found: as given, in the source tree, in an installation, in a workspace."""

import sys

import pytest

from haptic_device.config import files as config_files


@pytest.fixture
def prefixes(tmp_path, monkeypatch):
    """An installation and a workspace, each with a scene of its own."""
    for prefix, scene in (("venv", "installed"), ("workspace", "built")):
        folder = tmp_path / prefix / config_files.INSTALLED / "config" / "scenes"
        folder.mkdir(parents=True)
        (folder / f"{scene}.yaml").write_text(f"from: {prefix}\n")
        (folder / "both.yaml").write_text(f"from: {prefix}\n")
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "venv"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'none'}:{tmp_path / 'workspace'}")
    return tmp_path


def test_a_path_that_exists_is_taken_as_it_is_and_a_name_is_found_in_the_source_tree(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("")
    assert config_files.find("scenes", path) == path
    found = config_files.find("scenes", "peg_in_hole")
    assert found.is_file() and found.parts[-3:] == ("config", "scenes", "peg_in_hole.yaml")


def test_a_name_is_found_in_an_installation_and_in_a_workspace_the_former_first(prefixes):
    assert "venv" in config_files.find("scenes", "installed").parts
    assert "workspace" in config_files.find("scenes", "built").parts
    assert "venv" in config_files.find("scenes", "both").parts
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


@pytest.mark.parametrize("count", [0, config_files.SHOWN, config_files.SHOWN + 1])
def test_of_no_names_that_is_said_six_are_all_listed_and_of_seven_one_is_counted_without_a_guess(monkeypatch, count):
    monkeypatch.setattr(config_files, "names", lambda folder: [f"scene_{k}" for k in range(count)])
    with pytest.raises(FileNotFoundError) as caught:
        config_files.find("scenes", "nowhere")
    assert ("and 1 more" in str(caught.value)) == (count > config_files.SHOWN)
    assert ("has no file at all" in str(caught.value)) == (count == 0) and "did you mean" not in str(caught.value)


def test_a_folder_named_like_a_scene_is_not_taken_for_it(tmp_path, monkeypatch):
    (tmp_path / "peg_in_hole").mkdir()
    monkeypatch.chdir(tmp_path)
    assert config_files.find("scenes", "peg_in_hole").suffix == ".yaml"
