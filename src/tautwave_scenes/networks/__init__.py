"""Mass-interaction networks that a hand can hold: text -> checked -> pruned -> arrays -> steps.

`network` is the plain data, `pruning` removes elements, `parallel_links` merges identical ones,
`compiling` lays everything out as arrays, `stepping` and `gradient` advance them (plain Python
live, compiled by `tautwave.simulation`), `exact` does the linear ones by matrix exponential,
`strings` are delay lines, `ledger` adds up the energy.
"""
