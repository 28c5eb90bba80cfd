# SPDX-License-Identifier: Apache-2.0
"""Speed against error: cases, references, the methods and their peers measured alike. No loop imports this."""
