"""An experiment that runs at the rate of real time while it is played with.

`session` steps the simulation, and knows neither a clock nor a network: what it is told comes
through `controls`, whose names and bounds are all that a page can reach. `pace` is the clock,
`serving` the network, `scene` and `page` what is seen, and `play` puts them together.
"""
