"""The sensors: what cheap devices make of the truth.  `suite.Suite` is what the loop flies with."""
