# SPDX-License-Identifier: Apache-2.0
"""The page of all scenes, with a film of each."""

from PIL import Image

from haptic_display.page.film import gallery
from haptic_sim.scene.language import load

PNG = b"\x89PNG\r\n\x1a\n"


def test_the_gallery_has_a_section_and_a_picture_for_every_scene(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "names", lambda folder: ["wall", "four_bar"])
    gallery.write_gallery(tmp_path / "page")
    page = (tmp_path / "page" / "README.md").read_text()
    for name in ("wall", "four_bar"):
        assert f"![{load(name).description}, at the start]({name}.png)" in page
        assert (tmp_path / "page" / f"{name}.png").read_bytes().startswith(PNG)
        assert f'<img src="{name}.gif" loading="lazy" alt="{load(name).description}, a film">' in page
        with Image.open(tmp_path / "page" / f"{name}.gif") as film:
            assert film.format == "GIF" and film.n_frames > 10
