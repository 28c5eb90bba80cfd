# SPDX-License-Identifier: Apache-2.0
"""What people touch: the `haptic` command, the page, runs and their reports, the tools for devices."""
