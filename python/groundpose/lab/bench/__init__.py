"""What the numbers are that users quote: `groundpose bench`, its baseline and docs/performance.md.

Upwards: `scenes` (objects with known truth), `contenders` (who is timed), `races` (how), `special` (what is
no race), `sources` (what needs a Rust toolchain), `cases` (the table of all), `run` (resumable); from stored
numbers `baseline` (comparison), `bars`, `stages`, `figure`, `tell` and `page`.
"""
