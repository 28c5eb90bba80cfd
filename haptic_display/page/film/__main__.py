# SPDX-License-Identifier: Apache-2.0
"""`python -m haptic_display.page.film BAG` writes the page that plays a bag to standard output, for the live page."""

import sys
from pathlib import Path

from haptic_device.os_errors import in_words
from haptic_display.page.film.page import page_of
from haptic_display.page.film.reading import film_of
from haptic_display.run.report.reading import read_run


def main(bag: str) -> None:
    """Exit code 1, and a sentence on standard error, for a bag that cannot be shown."""
    try:
        text = page_of([film_of(read_run(Path(bag)))])
    except (ValueError, OSError) as error:
        sys.exit(in_words(error))
    sys.stdout.buffer.write(text.encode())


if __name__ == "__main__":
    main(sys.argv[1])
