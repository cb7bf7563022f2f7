"""The summary at the end of a recording: written after the data, read before it."""

from collections.abc import Sequence
from io import BytesIO

from mcap import records

from mcap_landmarks.recording.checksum import crc32
from mcap_landmarks.recording.container import MAGIC, RECORD, Opcode, serialize

_OPCODES = {
    records.Schema: Opcode.SCHEMA,
    records.Channel: Opcode.CHANNEL,
    records.Statistics: Opcode.STATISTICS,
    records.ChunkIndex: Opcode.CHUNK_INDEX,
    records.AttachmentIndex: Opcode.ATTACHMENT_INDEX,
    records.MetadataIndex: Opcode.METADATA_INDEX,
}


def attachment_index(attachment: records.Attachment, offset: int, length: int) -> records.AttachmentIndex:
    """The index of an attachment whose record has its place and length."""
    return records.AttachmentIndex(
        offset=offset,
        length=length,
        log_time=attachment.log_time,
        create_time=attachment.create_time,
        data_size=len(attachment.data),
        name=attachment.name,
        media_type=attachment.media_type,
    )


def summary_section(groups: Sequence[Sequence[records.McapRecord]], offset: int) -> bytes:
    """Everything from the end of the data section on, which lies at `offset`; empty groups are left out."""
    out = BytesIO()
    offsets: list[records.McapRecord] = []
    for group in groups:
        if group:
            data = serialize(*group)
            offsets.append(
                records.SummaryOffset(
                    group_opcode=_OPCODES[type(group[0])], group_start=offset + out.tell(), group_length=len(data)
                )
            )
            out.write(data)
    offsets_start = offset + out.tell()
    out.write(serialize(*offsets))
    out.write(RECORD.pack(Opcode.FOOTER, 20))
    out.write(offset.to_bytes(8, "little") + offsets_start.to_bytes(8, "little"))
    crc = crc32(out.getvalue())
    return out.getvalue() + crc.to_bytes(4, "little") + MAGIC
