"""Mass-interaction networks that a hand can hold: text -> checked -> pruned -> arrays -> steps.

`network` is the plain data, `pruning` leaves out, `parallel_links` makes one link of alike ones,
`compiling` lays it all out as arrays, `stepping` and `gradient` advance them (plain Python live,
compiled by `tautwave.simulation`), `exact` does the linear ones by matrix exponential, `strings`
are lines, `ledger` adds up the energy.
"""
