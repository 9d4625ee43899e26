"""What sphinx-gallery shows of an example: the pictures that it saves, in the order of their time."""

import shutil
from pathlib import Path

from sphinx_gallery.scrapers import figure_rst


def scraper(block, block_vars, gallery_conf):
    """Move the pictures that a block has saved into the site; return the text that shows them."""
    folder = Path(block_vars["src_file"]).parent
    saved = sorted(folder.glob("*.png"), key=lambda path: path.stat().st_mtime_ns)
    shown = []
    for picture, path in zip(saved, block_vars["image_path_iterator"], strict=False):
        shutil.move(picture, path)
        shown.append(path)
    return figure_rst(shown, gallery_conf["src_dir"])
