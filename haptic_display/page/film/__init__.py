# SPDX-License-Identifier: Apache-2.0
"""A recording as a film: one page that plays it anywhere, and a short GIF."""
