"""Generate sections of EDS files as a vendor's tool would write them."""

PART = '[{index:X}{sub}]\nParameterName={name}\nDataType={kind}\nAccessType=rw\n{default}'


def record(index: int, subs: dict[int, tuple], name: str = '') -> str:
    """Return a record. ``subs`` maps each sub-index to its data type, its default or None, and optionally a name."""
    lines = f'[{index:X}]\nParameterName={name or f"x{index:X}"}\nObjectType=9\nSubNumber={len(subs)}\n'
    return lines + ''.join(PART.format(index=index, sub=f'sub{sub:X}', kind=kind,
                                       name=names[0] if names else f'x{index:X}sub{sub:X}',
                                       default='' if default is None else f'DefaultValue={default}\n')
                           for sub, (kind, default, *names) in subs.items())
