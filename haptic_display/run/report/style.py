# SPDX-License-Identifier: Apache-2.0
"""How a report looks: its verdict, and its page, light and dark; pictures stay on white."""

LEVELS = {"good": ("Good.", "#0b6b3a"), "warn": ("Look at this.", "#8a4b00"), "bad": ("Not good.", "#a3160f")}
"""Of a verdict: words, and their colour on white."""
STYLE = """
:root { color-scheme: light dark; --ink: #1a1a1a; --quiet: #4a4f55; --paper: #fff; --line: #c9cdd2; --link: #0a4f8a;
  --good: #0b6b3a; --warn: #8a4b00; --bad: #a3160f; --box: #f4f5f7 }
@media (prefers-color-scheme: dark) { :root { --ink: #e8eaed; --quiet: #b4bac1; --paper: #14181d; --line: #3d454e;
  --link: #8ec5ff; --good: #6fd39b; --warn: #ffb963; --bad: #ff9088; --box: #1d232a } }
body { font: 15px/1.4 sans-serif; color: var(--ink); background: var(--paper); max-width: 1100px; margin: 0 auto;
  padding: .6em 1em 3em }
h1 { font-size: 1.4em; margin: 0 } h2, h3 { font-size: 1.1em; margin: 0 }
p { margin: .2em 0 } .quiet, figcaption, th { color: var(--quiet) } .quiet span { white-space: nowrap }
a { color: var(--link) }
.verdict { border-left: 6px solid var(--ink); background: var(--box); padding: .3em .8em; margin: .4em 0 }
.verdict.good { border-color: var(--good) } .verdict.warn { border-color: var(--warn) }
.verdict.bad { border-color: var(--bad) }
.good strong { color: var(--good) } .warn strong { color: var(--warn) } .bad strong { color: var(--bad) }
.verdict svg { vertical-align: middle; background: #fff }
.notes { border: 1px solid var(--warn); padding: .2em .8em; margin: .4em 0 }
nav ul { list-style: none; display: flex; flex-wrap: wrap; margin: 0; padding: 0 }
nav a { display: block; padding: 0 .55em; min-width: 44px; line-height: 44px; box-sizing: border-box;
  text-align: center }
figure { margin: 0 0 1.4em; break-inside: avoid }
img { display: block; box-sizing: border-box; max-width: 100%; height: auto; background: #fff; padding: 4px;
  border-radius: 4px }
table { border-collapse: collapse; width: 100%; table-layout: fixed }
td, th { text-align: left; vertical-align: top; padding: .15em .6em .15em 0; border-bottom: 1px solid var(--line) }
td { overflow-wrap: anywhere } th { font-weight: normal } tr > th:first-child { width: 24% }
summary { cursor: pointer; min-height: 44px; line-height: 44px } summary h3 { display: inline }
@media print { body { font-size: 10pt; max-width: none } nav { display: none } h2 { break-after: avoid } }
"""
