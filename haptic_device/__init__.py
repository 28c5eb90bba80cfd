# SPDX-License-Identifier: Apache-2.0
"""What moves a handle: laws, servo, links, nodes, recordings, theory. Never imports haptic_sim or haptic_display."""
