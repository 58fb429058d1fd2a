"""The catalogue of joint and force kinds, as data and small functions, one file a kind; the stages interpret it."""
