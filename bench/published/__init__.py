# SPDX-License-Identifier: Apache-2.0
"""Results of others: one YAML file a source says what was published, one module a source computes it with our code."""
