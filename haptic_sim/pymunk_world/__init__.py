# SPDX-License-Identifier: Apache-2.0
"""The method `impulse`: a scene as a pymunk Space."""
