"""The catalogue: what each kind of joint is, as data, one file a kind; the stages interpret it."""
