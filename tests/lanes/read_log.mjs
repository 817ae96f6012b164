// Read an MCAP file of ROS 2 messages as Foxglove does; printed as read_log.py prints it.
// node read_log.mjs FILE, in a folder with @mcap/core @mcap/nodejs @mcap/support @foxglove/rosmsg
// and @foxglove/rosmsg2-serialization.
import { open } from "node:fs/promises";
import { createRequire } from "node:module";

const require = createRequire(process.cwd() + "/");
const { McapIndexedReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");
const { loadDecompressHandlers } = require("@mcap/support");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");

const nanoseconds = ({ stamp }) => stamp.sec * 1e9 + (stamp.nanosec ?? stamp.nsec);
const numbers = (value) =>
  typeof value === "number"
    ? [value]
    : Object.entries(value)
        .filter(([name]) => !["header", "name", "child_frame_id"].includes(name))
        .flatMap(([, part]) => numbers(part));

const reader = await McapIndexedReader.Initialize({
  readable: new FileHandleReadable(await open(process.argv[2])),
  decompressHandlers: await loadDecompressHandlers(),
});
const readers = new Map();
const found = {};
for await (const { channelId, data, logTime } of reader.readMessages()) {
  const { topic, schemaId } = reader.channelsById.get(channelId);
  if (!readers.has(topic)) {
    const text = new TextDecoder().decode(reader.schemasById.get(schemaId).data);
    readers.set(topic, new MessageReader(parse(text, { ros2: true })));
  }
  const message = readers.get(topic).readMessage(data);
  const { header } = message.transforms?.[0] ?? message;
  (found[topic] ??= []).push([Number(logTime), nanoseconds(header), ...numbers(message)]);
}
console.log(JSON.stringify(found));
