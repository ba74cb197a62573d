#include "tools/campaign/sqlite_database.h"

#include <sqlite3.h>

#include <array>
#include <fstream>
#include <string_view>

#include "common/errors.h"

namespace holdfast {
namespace {

[[noreturn]] void fail(const std::string& file, sqlite3* database, int result) {
  if ((result & 0xff) == SQLITE_BUSY)
    throw JobError(file + ": in use by another program; wait for it, or take another file");
  if ((result & 0xff) == SQLITE_NOTADB || (result & 0xff) == SQLITE_CORRUPT)
    throw UsageError(file + ": no results file (not SQLite, or damaged); take another name");
  if ((result & 0xff) == SQLITE_CANTOPEN)
    throw JobError(file + ": cannot be opened; are the folder and the file there to be written?");
  throw JobError(file + ": " +
                 (database != nullptr ? sqlite3_errmsg(database) : sqlite3_errstr(result)));
}

}  // namespace

void SqliteStatement::Finalize::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

SqliteStatement::SqliteStatement(sqlite3* database, const std::string& file, const std::string& sql)
    : database_(database), file_(file) {
  sqlite3_stmt* statement = nullptr;
  check(
      sqlite3_prepare_v2(database, sql.c_str(), static_cast<int>(sql.size()), &statement, nullptr));
  statement_.reset(statement);
}

void SqliteStatement::check(int result) const {
  if (result != SQLITE_OK) fail(file_, database_, result);
}

SqliteStatement& SqliteStatement::bind(std::int64_t value) {
  check(sqlite3_bind_int64(statement_.get(), ++num_bound_, value));
  return *this;
}

SqliteStatement& SqliteStatement::bind(const std::string& value) {
  check(sqlite3_bind_text64(statement_.get(), ++num_bound_, value.data(), value.size(),
                            SQLITE_TRANSIENT, SQLITE_UTF8));
  return *this;
}

SqliteStatement& SqliteStatement::bind(std::span<const std::uint8_t> value) {
  ++num_bound_;
  // A null pointer would be NULL, not an empty blob.
  check(value.empty() ? sqlite3_bind_zeroblob(statement_.get(), num_bound_, 0)
                      : sqlite3_bind_blob64(statement_.get(), num_bound_, value.data(),
                                            value.size(), SQLITE_TRANSIENT));
  return *this;
}

SqliteStatement& SqliteStatement::bind_null() {
  check(sqlite3_bind_null(statement_.get(), ++num_bound_));
  return *this;
}

bool SqliteStatement::step() {
  const int result = sqlite3_step(statement_.get());
  if (result == SQLITE_ROW) return true;
  sqlite3_reset(statement_.get());
  num_bound_ = 0;
  if (result != SQLITE_DONE) fail(file_, database_, result);
  return false;
}

void SqliteStatement::run() {
  while (step()) continue;
}

std::int64_t SqliteStatement::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

bool SqliteStatement::is_null(int column) const {
  return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
}

std::string SqliteStatement::text(int column) const {
  const std::span<const std::uint8_t> data = bytes(column);
  return {data.begin(), data.end()};
}

std::span<const std::uint8_t> SqliteStatement::bytes(int column) const {
  const void* data = sqlite3_column_blob(statement_.get(), column);
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column));
  return {static_cast<const std::uint8_t*>(data), data == nullptr ? 0 : size};
}

void SqliteDatabase::Close::operator()(sqlite3* database) const {
  sqlite3_close_v2(database);
}

SqliteDatabase::SqliteDatabase(const std::string& file, Mode mode) : file_(file) {
  sqlite3* database = nullptr;
  const int flags =
      mode == Mode::kRead ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
  const int result = sqlite3_open_v2(file.c_str(), &database, flags, nullptr);
  database_.reset(database);
  if (result != SQLITE_OK) fail(file_, database, result);
  sqlite3_extended_result_codes(database, 1);
  if (mode == Mode::kRead) {
    sqlite3_busy_timeout(database, 2000);
    execute("PRAGMA schema_version");
    return;
  }
  // Every series of a campaign grows at an end of its own: in the usual 2 MB of cache and 4 kB of
  // page, most inserts would read and write files. A rollback journal works on network file systems
  // too, where a write-ahead log does not.
  execute(
      "PRAGMA page_size=16384; PRAGMA cache_size=-65536;"
      "PRAGMA locking_mode=EXCLUSIVE; PRAGMA journal_mode=DELETE; PRAGMA synchronous=NORMAL;"
      "BEGIN EXCLUSIVE; COMMIT");
}

SqliteStatement SqliteDatabase::prepare(const std::string& sql) {
  return {database_.get(), file_, sql};
}

void SqliteDatabase::execute(const std::string& sql) {
  const int result = sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr);
  if (result != SQLITE_OK) fail(file_, database_.get(), result);
}

bool is_sqlite_file(const std::string& file) {
  constexpr std::string_view kMagic{"SQLite format 3\0", 16};
  std::array<char, 16> head{};
  std::ifstream stream(file, std::ios::binary);
  stream.read(head.data(), head.size());
  return stream && std::string_view(head.data(), head.size()) == kMagic;
}

}  // namespace holdfast
