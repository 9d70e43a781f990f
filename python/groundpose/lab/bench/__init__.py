"""What the numbers are that users quote: `groundpose bench`, its baseline and docs/performance.md.

Upwards: `scenes` (objects with known truth), `races` (how contenders are timed), `special` (what is no race),
`sources` (what needs a Rust toolchain), `cases` (the table of all), `run` (resumable); from stored numbers
`baseline` (comparison), `targets`, `stages`, `figure`, `tell` and `page`.
"""
