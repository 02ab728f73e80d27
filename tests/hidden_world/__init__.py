"""The hidden world: an independent generator of measurement campaigns, and the trial that scores a diagnosis on them.

It shares no code with `spikecam_env`: its own equations (`integrator`), its own fixed patterns (`unit`), its own light
(`light`), its own writer (`campaign`).  Hidden mechanisms: `catalogue` (effects that the diagnosis knows), `outside`
(mechanisms that it does not), `tricky` (labels that lie, effects in one place or at one time).
`cases` lists the trial, `keys` seals the answers, `score` compares.  By hand:

    python -m tests.hidden_world.generate --mechanism dead_time --times-limit 5 --seed 1 --out DIR
"""
