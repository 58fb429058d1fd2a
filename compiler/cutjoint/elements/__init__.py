"""The catalogue: what each kind of joint and of force is, as data and small functions, one file a kind; the stages interpret it."""
