"""Prints the columns of a table as JSON, as a library reads it: READER FILE. Kinds are whole, number, flag and text."""

import json
import sys

WORDS = {
    "whole": ("Int64", "BIGINT"),
    "number": ("Float64", "DOUBLE"),
    "flag": ("boolean", "Boolean", "BOOLEAN"),
    "text": ("string", "String", "VARCHAR"),
}


def pandas(path):
    import pandas

    table = pandas.read_parquet(path, dtype_backend="numpy_nullable")
    kinds = {name: str(kind) for name, kind in table.dtypes.items()}
    values = {name: [None if pandas.isna(x) else x for x in table[name].tolist()] for name in table.columns}
    return kinds, values


def polars(path):
    import polars

    table = polars.read_parquet(path)
    return {name: str(kind) for name, kind in table.schema.items()}, table.to_dict(as_series=False)


def duckdb(path):
    import duckdb

    table = duckdb.read_parquet(path)
    rows = table.fetchall()
    kinds = {name: str(kind) for name, kind in zip(table.columns, table.types)}
    return kinds, {name: [row[at] for row in rows] for at, name in enumerate(table.columns)}


def kind(name):
    return next((word for word, names in WORDS.items() if name in names), name)


kinds, values = {"pandas": pandas, "polars": polars, "duckdb": duckdb}[sys.argv[1]](sys.argv[2])
print(json.dumps({"kinds": {name: kind(of) for name, of in kinds.items()}, "values": values}))
