// SPDX-License-Identifier: Apache-2.0
// Typed, named device memory. T is what the kernel sees: a scalar, or a struct of 4-byte scalars
// (never float3, which is 16 bytes in OpenCL C). Fresh contents are undefined. If the queue poisons
// them (Queue::poisons) they are `poison`, so that reading before writing shows: as a float, a NaN
// that no arithmetic makes; as an index, one that no array has.
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "runtime/cl/queue.hpp"

namespace gflow {

constexpr cl_uint poison = 0x7fc0dead;

// `size` elements of T in device memory; 0 is allowed. Movable, not copyable.
template <class T>
class Buffer {
 public:
  // An empty buffer, to be sized by ensure().
  explicit Buffer(std::string name = "unnamed buffer") : name_(std::move(name)) {}
  Buffer(Queue& queue, size_t size, std::string name) : name_(std::move(name)) {
    allocate(queue, size, size);
  }
  Buffer(Queue& queue, const std::vector<T>& data, std::string name)
      : Buffer(queue, data.size(), std::move(name)) {
    write(queue, data);
  }
  // Without this one, {5} would be taken for a size.
  Buffer(Queue& queue, std::initializer_list<T> data, std::string name)
      : Buffer(queue, std::vector<T>(data), std::move(name)) {}
  Buffer(Buffer&&) = default;
  Buffer& operator=(Buffer&&) = default;
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  // Sets the size. Contents are undefined afterwards, unless it was the size before. Reallocates
  // only if the memory held is too small, then with a quarter to spare, so that repeated growth
  // seldom reallocates.
  void ensure(Queue& queue, size_t size) {
    if (size <= capacity_ && handle_()) {
      if (size != size_) poison_all(queue);
      size_ = size;
      return;
    }
    const size_t most = size_t(queue.info.max_allocation / sizeof(T));
    handle_ = cl::Buffer();  // frees the old memory first: both may not fit
    size_ = capacity_ = 0;
    allocate(queue, size, std::max(size, std::min(size + size / 4, most)));
  }

  // Copies the whole buffer from the host; blocks.
  void write(Queue& queue, const std::vector<T>& data) {
    check(data.size() == size_, "writing", 0, data.size());
    write_range(queue, 0, data);
  }
  // Copies data to elements first, first + 1, ...; blocks.
  void write_range(Queue& queue, size_t first, const std::vector<T>& data) {
    enqueue_write(queue, first, data, CL_TRUE);
  }
  // Copies size() elements from the host; blocks.
  void write_from(Queue& queue, const T* data) {
    if (size_)
      queue.wait("writing " + describe(), [&] {
        queue.handle.enqueueWriteBuffer(handle_, CL_TRUE, 0, size_ * sizeof(T), data);
      });
  }
  // Like write(), but does not block: the caller keeps `data` alive and unchanged until the queue
  // was waited for (finish() or any blocking read).
  void write_async(Queue& queue, const std::vector<T>& data) {
    check(data.size() == size_, "writing", 0, data.size());
    enqueue_write(queue, 0, data, CL_FALSE);
  }

  // The whole contents; blocks until all queued work is done.
  std::vector<T> read(Queue& queue) const { return read_range(queue, 0, size_); }
  // Copies size() elements to the host; blocks likewise.
  void read_to(Queue& queue, T* data) const {
    if (size_)
      queue.wait("reading " + describe(), [&] {
        queue.handle.enqueueReadBuffer(handle_, CL_TRUE, 0, size_ * sizeof(T), data);
      });
  }
  // Like read(), but does not block: the caller keeps `data` alive until the event was waited for.
  cl::Event read_async(Queue& queue, std::vector<T>& data) const {
    data.resize(size_);
    cl::Event event;
    if (size_)
      cl_call("reading " + describe(), [&] {
        queue.handle.enqueueReadBuffer(handle_, CL_FALSE, 0, size_ * sizeof(T), data.data(),
                                       nullptr, &event);
      });
    return event;
  }
  // Elements first .. first + count - 1; blocks likewise.
  std::vector<T> read_range(Queue& queue, size_t first, size_t count) const {
    check_range("reading", first, count);
    std::vector<T> data(count);
    if (count)
      queue.wait("reading " + describe(), [&] {
        queue.handle.enqueueReadBuffer(handle_, CL_TRUE, first * sizeof(T), count * sizeof(T),
                                       data.data());
      });
    return data;
  }

  // Sets every element to `value`; does not block.
  void fill(Queue& queue, T value) { fill_range(queue, 0, size_, value); }
  void fill_range(Queue& queue, size_t first, size_t count, T value) {
    check_range("filling", first, count);
    if (count)
      cl_call("filling " + describe(), [&] {
        queue.handle.enqueueFillBuffer(handle_, value, first * sizeof(T), count * sizeof(T));
      });
  }

  // Copies all of `other`, which must have this buffer's size; does not block.
  void copy_from(Queue& queue, const Buffer& other) {
    check(other.size_ == size_, "copying", 0, other.size_);
    copy_range(queue, other, 0, 0, size_);
  }
  // Copies `count` elements, other[from...] to this[to...]; does not block.
  void copy_range(Queue& queue, const Buffer& other, size_t from, size_t to, size_t count) {
    other.check_range("copying from", from, count);
    check_range("copying to", to, count);
    if (count)
      cl_call("copying " + other.describe() + " to " + describe(), [&] {
        queue.handle.enqueueCopyBuffer(other.handle_, handle_, from * sizeof(T), to * sizeof(T),
                                       count * sizeof(T));
      });
  }

  // Exchanges memory and size with `other`; each keeps its name.
  void swap_memory(Buffer& other) {
    std::swap(handle_, other.handle_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

  size_t size() const { return size_; }
  size_t capacity() const { return capacity_; }  // elements that fit into the memory held
  const std::string& name() const { return name_; }
  const cl::Buffer& handle() const { return handle_; }

 private:
  void allocate(Queue& queue, size_t size, size_t capacity) {
    const uint64_t have = queue.info.max_allocation;
    if (size > have / sizeof(T))
      throw OutOfMemory(
          fmt::format("allocating {}: {} elements of {} bytes need {:.1f} MiB in one buffer, but "
                      "{} allows at most {:.1f} MiB",
                      name_, size, sizeof(T), double(size) * sizeof(T) / (1 << 20),
                      queue.info.full_name(), double(have) / (1 << 20)));
    size_ = size;
    capacity_ = std::max<size_t>(capacity, 1);  // OpenCL has no empty buffers
    handle_ = cl_call("allocating " + describe(), [&] {
      return cl::Buffer(queue.context, CL_MEM_READ_WRITE, capacity_ * sizeof(T));
    });
    poison_all(queue);
  }

  void poison_all(Queue& queue) {
    using Pattern = std::conditional_t<
        sizeof(T) % 4 == 0, cl_uint,
        std::conditional_t<sizeof(T) % 2 == 0, cl_ushort, cl_uchar>>;  // must divide the size
    if (!queue.poisons()) return;
    cl_call("poisoning " + describe(), [&] {
      queue.handle.enqueueFillBuffer(handle_, Pattern(poison), 0, capacity_ * sizeof(T));
    });
  }

  void enqueue_write(Queue& queue, size_t first, const std::vector<T>& data, cl_bool wait) {
    check_range("writing", first, data.size());
    if (data.empty()) return;
    const auto call = [&] {
      queue.handle.enqueueWriteBuffer(handle_, wait, first * sizeof(T), data.size() * sizeof(T),
                                      data.data());
    };
    wait ? queue.wait("writing " + describe(), call) : cl_call("writing " + describe(), call);
  }

  void check_range(const char* doing, size_t first, size_t count) const {
    check(first <= size_ && count <= size_ - first, doing, first, count);
  }
  void check(bool fits, const char* doing, size_t first, size_t count) const {
    if (!fits)
      throw Error(fmt::format("{} {}: {} elements from element {} are out of range", doing,
                              describe(), count, first));
  }
  std::string describe() const {
    return fmt::format("{} [{} x {} bytes]", name_, size_, sizeof(T));
  }

  cl::Buffer handle_;
  size_t size_ = 0, capacity_ = 0;
  std::string name_;
};

// How a kernel uses a buffer: In<T> is `global const T*`, Out<T> is `global T*` (written, or read
// and written). Kernel checks both against the compiled kernel's own signature.
template <class T>
struct In {
  In(const Buffer<T>& buffer) : handle(buffer.handle()) {}
  cl::Buffer handle;
};
template <class T>
struct Out {
  Out(Buffer<T>& buffer) : handle(buffer.handle()) {}
  cl::Buffer handle;
};

}  // namespace gflow
