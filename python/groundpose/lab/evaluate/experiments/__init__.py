"""The paper's synthetic experiments E1 to E4 and HRE (sec. 4.1, Figs. 4 and 5) with every contender.

A file imports only what stands before it: `settings` (what is varied), `outcome`, `polish`, `contenders` (who
takes part), `libraries`, `entry` (all of them by name), `store` (results as JSON), `run`, `compare`,
`series`, `figures`, `findings`, `page`."""
