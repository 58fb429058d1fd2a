"""Sweeps: many runs of a model by a design, on this machine or a cluster, into one table.

    study.yaml -> Study -> Plan -> chunks of runs -> parts of a table -> table and page
"""
