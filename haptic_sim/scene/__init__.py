# SPDX-License-Identifier: Apache-2.0
"""The scene language: shapes, joints, materials, the tool, and whether they fit together."""
