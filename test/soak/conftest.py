# SPDX-License-Identifier: Apache-2.0
"""What is waited for here may take long: kernels are compiled, and a run goes on beside."""

import waiting

waiting.LIMIT = 600.0  # [s]
