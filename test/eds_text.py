"""Sections of EDS files, as a vendor's tool writes them."""

PART = '[{index:X}{sub}]\nParameterName={name}\nDataType={kind}\nAccessType=rw\n{default}'


def record(index: int, subs: dict[int, tuple], name: str = '') -> str:
    """A record; ``subs``: sub-index -> data type, default or None, name if it is to have one."""
    lines = f'[{index:X}]\nParameterName={name or f"x{index:X}"}\nObjectType=9\nSubNumber={len(subs)}\n'
    return lines + ''.join(PART.format(index=index, sub=f'sub{sub:X}', kind=kind,
                                       name=names[0] if names else f'x{index:X}sub{sub:X}',
                                       default='' if default is None else f'DefaultValue={default}\n')
                           for sub, (kind, default, *names) in subs.items())
